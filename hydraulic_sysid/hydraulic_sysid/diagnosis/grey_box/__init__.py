"""Grey box: a black-box model of what a physical model leaves, to tell how much is left to be named."""

from .bridge import grey_box
from .errors import GreyBoxError

__all__ = ["GreyBoxError", "grey_box"]
