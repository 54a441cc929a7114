"""Where a model fails: the balances of force and flow that the measured signals must keep, and which one they break.

`balances` forms them, `noise_model` says how much of each is measurement noise, `directions` what each subsystem can do
to them, `blame` how much of what is left each subsystem explains, `document` gathers the figures.
"""

from .balances import LocateError
from .document import balance_figures, locate

__all__ = ["LocateError", "balance_figures", "locate"]
