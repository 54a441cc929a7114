"""What can be set on a controller: name, unit, default and range, in one table.

The ROS parameters of the node, the parameter files that `tune` writes and the arrays that the compiled step reads
all derive from it.

Errors are in metres. The published gain k = 4 − 3·sech(0.05·e) [1] names no unit for e: 0.05 does nothing for errors
in metres or inches of a 60 in actuator, so it can only be per millimetre, which makes k₂ = 50 1/m here.

[1] Z. Nisar, H. Munawar, System Identification and Controller Design for Hydraulic Actuator, eq. (k = 4 − 3 sech).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from hydraulic_control.errors import ControlError
from hydraulic_interfaces.contract import DRIVE_LIMIT_V
from hydraulic_node_utils.parameter_spec import ParameterSpec

CONTROLLERS = ("npid", "pid", "pole_placement")
ANTIWINDUP = ("none", "back_calculation", "conditional_integration")


def _live(name: str, default: float, text: str, unit: str, low: float, high: float) -> ParameterSpec:
    return ParameterSpec(name, default, text, unit, low, high, live=True)


def _choice(name: str, default: str, choices: tuple[str, ...], text: str) -> ParameterSpec:
    return ParameterSpec(name, default, text, live=True, choices=choices)


LAW: tuple[ParameterSpec, ...] = (
    _choice("controller", "npid", CONTROLLERS, f"law: {', '.join(CONTROLLERS)} (pid is npid with k = 1)"),
    _live("kp", 60.0, "proportional gain", "V/m", 0.0, 1e5),
    _live("ki", 0.0, "integral gain", "V/(m*s)", 0.0, 1e6),
    _live("kd", 0.0, "derivative gain, on the measured position", "V*s/m", 0.0, 1e4),
    _live("k0", 1.0, "nonlinear gain at no error", "1", 0.0, 100.0),
    _live("k1", 3.0, "rise of the nonlinear gain up to large errors", "1", 0.0, 100.0),
    _live("k2", 50.0, "how fast it rises with the error", "1/m", 0.0, 1e5),
    _live("derivative_time", 2e-3, "time constant of the filter on the derivative", "s", 0.0, 1.0),
    _choice("antiwindup", "conditional_integration", ANTIWINDUP, f"of the integral: {', '.join(ANTIWINDUP)}"),
    _live("tracking_time", 0.1, "time constant of back-calculation", "s", 1e-3, 100.0),
    _live("integral_zone", 1e-3, "error at which integration is down to a half; 0: never", "m", 0.0, 100.0),
    _live("integral_limit", 2.0, "largest contribution of the integral", "V", 0.0, DRIVE_LIMIT_V),
    _live("drive_limit", DRIVE_LIMIT_V, "largest drive", "V", 0.0, DRIVE_LIMIT_V),
    _live("slew_limit", 2000.0, "fastest change of the drive", "V/s", 1.0, 1e6),
    _live("velocity_feedforward", 0.0, "drive per reference velocity: 1/velocity gain of the plant", "V*s/m", 0.0, 1e3),
    _live("force_feedback", 0.0, "dynamic pressure feedback: drive per changing force", "V/N", 0.0, 1.0),
    _live("force_time", 2e-3, "time constant of its high pass", "s", 1e-4, 10.0),
    _live("deadband", 0.0, "half width of the dead band that is jumped", "V", 0.0, 2.0),
    _live("deadband_width", 0.02, "drive over which the jump is spread", "V", 1e-4, 2.0),
    _live("bumpless_time", 0.1, "decay of the offset that makes changes bumpless", "s", 1e-3, 10.0),
    _live("pole_placement.velocity_gain", 0.0434, "of the model K/(s(Ts + 1))", "m/(s*V)", 1e-6, 10.0),
    _live("pole_placement.lag", 5e-3, "T of the model", "s", 1e-4, 10.0),
    _live("pole_placement.frequency", 10.0, "of the closed loop's poles", "rad/s", 0.1, 500.0),
    _live("pole_placement.damping", 1.0, "of the closed loop's poles", "1", 0.1, 2.0),
    _live("pole_placement.observer", 30.0, "of the observer's poles", "rad/s", 0.1, 1000.0),
    _live("pole_placement.period", 0.01, "sampling time of the polynomials", "s", 1e-3, 1.0),
)

SPECS = {spec.name: spec for spec in LAW}


def check(name: str, value: Any) -> Any:
    """`value` of the parameter of that name, in its type.

    :raises HydraulicError: unknown name, or a value that the parameter cannot have.
    """
    if name not in SPECS:
        raise ControlError(f"{name!r} is no parameter of the controller; there are {', '.join(SPECS)}")
    return SPECS[name].check(value)


def complete(values: Mapping[str, Any]) -> dict[str, Any]:
    """All parameters: `values` where given and found acceptable (`check`), else defaults."""
    return {spec.name: spec.default for spec in LAW} | {name: check(name, value) for name, value in values.items()}


def as_number(name: str, value: Any) -> float:
    """A parameter as the compiled step reads it: choices by their place in the list."""
    choices = SPECS[name].choices
    return float(choices.index(value)) if choices else float(value)


RECORD = np.dtype(
    [(name.replace(".", "_"), np.float64) for name in SPECS]
    + [(name, np.float64) for name in ("t0", "s0", "s1", "s2", "r1", "r2", "o1", "o2")]
)
"""One controller's parameters, and the polynomials of pole placement (see `pole_placement`)."""
