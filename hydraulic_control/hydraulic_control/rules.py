"""Rules that turn a critical point, or a simple model, into gains.

[1] J. G. Ziegler, N. B. Nichols, Optimum settings for automatic controllers, Trans. ASME 64 (1942) 759–768.
[2] B. D. Tyreus, W. L. Luyben, Tuning PI controllers for integrator/dead time processes, Ind. Eng. Chem. Res. 31 (1992)
    2625–2628; W. L. Luyben, M. L. Luyben, Essentials of Process Control, 1997: the PID form.
[3] K. J. Åström, T. Hägglund, Advanced PID Control, 2006, sec. 6.4: poles placed for a second-order model.
"""

from __future__ import annotations

from dataclasses import dataclass

from hydraulic_control.errors import ControlError
from hydraulic_control.relay import CriticalPoint


@dataclass(frozen=True)
class Gains:
    """Kp [V/m], Ki [V/(m·s)] and Kd [V·s/m], named as the parameters of the controller."""

    kp: float
    ki: float
    kd: float


def _from_times(kp: float, integral_time: float, derivative_time: float) -> Gains:
    return Gains(kp, kp / integral_time, kp * derivative_time)


def ziegler_nichols(point: CriticalPoint) -> Gains:
    """0.6·K_c, T_i = T_c/2, T_d = T_c/8: a quarter of the amplitude from wave to wave, [1]."""
    return _from_times(0.6 * point.gain, 0.5 * point.period, 0.125 * point.period)


def tyreus_luyben(point: CriticalPoint) -> Gains:
    """K_c/2.2, T_i = 2.2·T_c, T_d = T_c/6.3: gentler, made for integrating plants, [2]."""
    return _from_times(point.gain / 2.2, 2.2 * point.period, point.period / 6.3)


def pole_placement(velocity_gain: float, lag: float, frequency: float, damping: float = 1.0) -> Gains:
    """Poles of the loop around K/(s(Ts + 1)) at ``frequency`` [rad/s] with ``damping`` and at a tenth of it, [3].

    T·s³ + (1 + K·Kd)·s² + K·Kp·s + K·Ki = T'·(s + ω/10)(s² + 2ζω·s + ω²) with the derivative left out where the lag
    alone is too short to need it: the gains that are negative are 0.

    :raises ControlError: values that are not positive.
    """
    if not min(velocity_gain, lag, frequency, damping) > 0.0:
        raise ControlError(
            f"pole placement: gain {velocity_gain:g}, lag {lag:g}, frequency {frequency:g} and damping {damping:g} "
            "must be positive"
        )
    slow = 0.1 * frequency
    total = slow + 2.0 * damping * frequency  # minus the sum of the poles
    # Where the lag asks for faster poles than wanted, the fastest pole is the lag's own and Kd stays 0.
    scale = lag if lag * total >= 1.0 else 1.0 / total
    kd = (scale * total - 1.0) / velocity_gain
    kp = scale * (frequency**2 + 2.0 * damping * frequency * slow) / velocity_gain
    return Gains(kp, scale * slow * frequency**2 / velocity_gain, max(kd, 0.0))


RULES = {"ziegler_nichols": ziegler_nichols, "tyreus_luyben": tyreus_luyben}
"""Those that start from a critical point."""
