"""Linear models identified from records: sampled and continuous, by least squares, instruments and prediction error."""

from hydraulic_sysid.linear.errors import IdentificationError

from .arx import ArxOrder, fit_arx
from .experiments import OFFSETS
from .instrumental_variables import fit_arx_instruments
from .model import LinearModel
from .model_file import read_linear_model, write_linear_model
from .order_selection import CRITERIA, Candidate, best, try_orders
from .recursive_arx import RecursiveArx
from .structures import Arx, StateSpace, Structure, TransferFunction
from .subspace import fit_state_space
from .transfer_function import TransferFunctionModel, TransferFunctionOrder
from .transfer_function_fit import fit_transfer_function

__all__ = [
    "ArxOrder",
    "fit_arx",
    "fit_transfer_function",
    "IdentificationError",
    "fit_arx_instruments",
    "LinearModel",
    "read_linear_model",
    "write_linear_model",
    "CRITERIA",
    "Candidate",
    "best",
    "try_orders",
    "RecursiveArx",
    "OFFSETS",
    "Arx",
    "StateSpace",
    "Structure",
    "TransferFunction",
    "fit_state_space",
    "TransferFunctionModel",
    "TransferFunctionOrder",
]
