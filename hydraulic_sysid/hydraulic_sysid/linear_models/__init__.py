"""Linear models identified from records: sampled and continuous, by least squares, instruments and prediction error."""

from .continuous_fit import fit_transfer_function
from .errors import IdentificationError
from .poles import Pole
from .transfer_function import TransferFunctionModel, TransferFunctionOrder

__all__ = [
    "IdentificationError",
    "Pole",
    "TransferFunctionModel",
    "TransferFunctionOrder",
    "fit_transfer_function",
]
