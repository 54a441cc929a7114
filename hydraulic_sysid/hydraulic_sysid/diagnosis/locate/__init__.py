"""Where a model fails: the balances of force and flow that the measured signals must keep, and which one they break.

`balances` forms them, `whitening` says how much of each is measurement noise, `regressors` what each subsystem can do
to them, `attribution` how much of what is left each subsystem explains, `document` gathers the figures.

Words: a *balance* is a residual of a physical equation; the *reference run* is the record that an exact model would
have made under the same noise; a *share* is the part of the excess over it that a subsystem explains.
"""

from .balances import LocateError
from .document import balance_figures, locate

__all__ = ["LocateError", "balance_figures", "locate"]
