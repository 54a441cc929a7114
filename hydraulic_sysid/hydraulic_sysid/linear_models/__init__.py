"""Linear models identified from records: sampled and continuous, by least squares, instruments and prediction error."""

from .arx import ArxModel, ArxOrder, fit_arx
from .continuous_fit import fit_transfer_function
from .errors import IdentificationError
from .instruments import fit_arx_instruments
from .model import LinearModel
from .poles import Pole
from .series import OFFSETS
from .state_space import StateSpaceModel
from .subspace import fit_state_space
from .transfer_function import TransferFunctionModel, TransferFunctionOrder

__all__ = [
    "OFFSETS",
    "ArxModel",
    "ArxOrder",
    "IdentificationError",
    "LinearModel",
    "Pole",
    "StateSpaceModel",
    "TransferFunctionModel",
    "TransferFunctionOrder",
    "fit_arx",
    "fit_arx_instruments",
    "fit_state_space",
    "fit_transfer_function",
]
