"""One step of a controller, compiled for its law: filters, the law, bumpless offset, limits."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path

import numpy as np
from numba.core.errors import NumbaExperimentalFeatureWarning

from hydraulic_control import fuzzy_rules, law_parts
from hydraulic_control.errors import ControlError
from hydraulic_control.law import Law, record
from hydraulic_node_utils import generated_code

_STEP = '''\
"""One step of a controller; made by hydraulic_control.compiled_law."""

import math

from numba import njit

from hydraulic_control.law_parts import clamp, filters, limited

LONGEST_STEP_S = 1.0
begin, drive, end = (njit(error_model="numpy")(FUNCTIONS[name]) for name in ("begin", "drive", "end"))


@njit(error_model="numpy")
def forget(s):
    s.integral = s.velocity = s.offset = 0.0
{forget}

@njit(cache=True, error_model="numpy")
def step(p_, s_, dt, reference, reference_velocity, position, force):
    p, s = p_[0], s_[0]
    if not (math.isfinite(reference) and math.isfinite(position) and 0.0 < dt <= LONGEST_STEP_S):
        s.running, s.drive = 0.0, 0.0
        return 0.0
    if s.running == 0.0:
        s.running, s.rebase = 1.0, 1.0
        forget(s)
        s.position, s.force = position, force
        s.slow_force = force if math.isfinite(force) else 0.0
        begin(p, s, position)
    damping = filters(p, s, dt, position, force)
    ahead = reference_velocity if math.isfinite(reference_velocity) else 0.0
    law = drive(p, s, dt, reference, ahead, position) + p.velocity_feedforward * ahead - damping
    s.offset = s.drive - clamp(law, p.drive_limit) if s.rebase else s.offset / (1.0 + dt / p.bumpless_time)
    s.rebase = 0.0
    wanted = law + s.offset
    s.drive = limited(p, s, dt, wanted)
    end(p, s, dt, reference - position, wanted)
    if not math.isfinite(wanted + s.drive + s.integral + s.velocity + s.slow_force + s.offset):
        s.running, s.drive = 0.0, 0.0
        return 0.0
    return s.drive
'''


_PARTS = (Path(law_parts.__file__), Path(fuzzy_rules.__file__))


def parameter_record(law: Law) -> np.dtype:
    """Fields of ``p``: shared parameters, the law's own, what its design makes of them."""
    own = tuple(
        (law.field(spec.name), ()) for spec in law.parameters if not isinstance(spec.default, str) or spec.choices
    )
    shared = tuple((spec.name, ()) for spec in law_parts.PARAMETERS)
    return record((*shared, *own, *law.derived))


def state_record(law: Law) -> np.dtype:
    """Fields of ``s``: what every controller remembers, and what the law does."""
    return record((*law_parts.STATE, *law.state))


@lru_cache(maxsize=64)
def compiled(law: Law) -> Callable[..., float]:
    """``step(p, s, dt, reference, reference_velocity, position, force)`` → drive [V]; p, s arrays of one record.

    A sample ``dt`` [s] after the last one: reference [m], its velocity [m/s], position [m], force [N] (NaN: not
    measured). 0 V and a fresh start for what is not finite.

    :raises ControlError: the law does not compile.
    """
    functions = {"begin": law.begin, "drive": law.drive, "end": law.end}
    try:
        step = generated_code.load(*_generated(law), functions).step
        with warnings.catch_warnings():  # what all laws share is compiled for the fields that all records begin with
            warnings.simplefilter("ignore", NumbaExperimentalFeatureWarning)
            step(np.zeros(1, parameter_record(law)), np.zeros(1, state_record(law)), 0.0, 0.0, 0.0, 0.0, 0.0)
        return step
    except OSError:
        raise
    except Exception as error:  # numba's own, and what it trips over
        place = law.drive.__code__.co_filename
        raise ControlError(f"{place}: does not compile: {type(error).__name__}: {error}") from error


def ready(law: Law) -> bool:
    """Whether `compiled` takes a moment, not seconds: it has been compiled on this machine before."""
    return any((generated_code.place(*_generated(law)).parent / "__pycache__").glob("*.nbi"))


def _generated(law: Law) -> tuple[str, str, list[str]]:
    """Name, text and what it rests on of a law's module."""
    forget = "\n".join(f"    s.{name}{'[:]' if shape else ''} = 0.0" for name, shape in law.state)
    sources = (Path(law.drive.__code__.co_filename), *_PARTS)
    rests_on = [law.name, *(file.read_text(encoding="utf-8") for file in sources)]
    return f"law_{law.name}", _STEP.replace("{forget}", forget), rests_on
