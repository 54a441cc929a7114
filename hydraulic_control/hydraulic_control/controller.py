"""A controller as the node and the simulations use it: parameters by name around the compiled step of its law."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from hydraulic_control import parameters
from hydraulic_control.compiled_law import compiled, parameter_record, state_record
from hydraulic_control.law import Law
from hydraulic_control.law_parts import PARAMETERS
from hydraulic_control.laws import laws


class Controller:
    """One of the laws; the drive is always finite and within ``drive_limit``.

    :param values: parameters by name (`parameters.LAW`); the others have their defaults
    :raises HydraulicError: an unknown name or a value that is not allowed.
    """

    _values: dict[str, Any]
    _record: np.ndarray
    _state: np.ndarray
    _step: Callable[..., float]

    def __init__(self, values: Mapping[str, Any] | None = None) -> None:
        self._adopt(parameters.complete(values or {}))

    @property
    def values(self) -> dict[str, Any]:
        """The parameters in use, by name."""
        return dict(self._values)

    @property
    def law(self) -> Law:
        """The law in use."""
        return laws()[self._values["controller"]]

    @property
    def drive(self) -> float:
        """The last drive [V]."""
        return float(self._state["drive"][0])

    @property
    def compiled(self) -> tuple[Callable[..., float], np.ndarray, np.ndarray]:
        """The compiled step, and the records of parameters and state that it takes; for loops compiled as a whole."""
        return self._step, self._record, self._state

    @property
    def running(self) -> bool:
        """Whether it has begun; before, and after `stop`, the next step starts afresh."""
        return bool(self._state["running"][0])

    def set(self, values: Mapping[str, Any]) -> None:
        """Change parameters, or the law, while running, without a bump in the drive.

        :raises HydraulicError: as the constructor; nothing is changed then.
        """
        changed = self._values | {name: parameters.check(name, value) for name, value in values.items()}
        if changed["controller"] != self._values["controller"]:
            drive = self.drive
            self._adopt(changed)
            self.stop(drive)
            return
        self._record = _record(self.law, changed)
        self._values = changed
        self._state["rebase"] = 1.0

    def stop(self, drive: float = 0.0) -> None:
        """Forget everything; the next step joins on to ``drive`` [V] without a bump."""
        self._state[:] = np.zeros(1, self._state.dtype)
        limit = self._values["drive_limit"]
        self._state["drive"] = min(max(drive, -limit), limit) if np.isfinite(drive) else 0.0

    def step(
        self, dt: float, reference: float, reference_velocity: float, position: float, force: float = float("nan")
    ) -> float:
        """Drive [V] for a sample ``dt`` [s] after the last.

        Reference [m], its velocity [m/s], position [m] and force [N] (NaN where not measured).
        """
        return self._step(self._record, self._state, dt, reference, reference_velocity, position, force)

    def _adopt(self, values: dict[str, Any]) -> None:
        law = laws()[values["controller"]]
        self._record, self._step = _record(law, values), compiled(law)  # may refuse: before anything is changed
        self._state = np.zeros(1, state_record(law))
        self._values = values


def _record(law: Law, values: Mapping[str, Any]) -> np.ndarray:
    """The record of a law's parameters."""
    found = np.zeros(1, parameter_record(law))
    for spec in (*PARAMETERS, *law.parameters):
        if law.field(spec.name) in (found.dtype.names or ()):
            found[law.field(spec.name)] = parameters.as_number(spec.name, values[spec.name])
    for name, value in law.design(values).items():
        found[name] = value
    return found
