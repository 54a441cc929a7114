"""Grey box: a black-box model of what a physical model leaves, to say how much is left to be named."""

from .document import GreyBoxError, grey_box

__all__ = ["GreyBoxError", "grey_box"]
