"""A controller as the node and the simulations use it: parameters by name around the compiled step."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from hydraulic_control import parameters, pole_placement
from hydraulic_control.kernel import STATE, step
from hydraulic_control.parameters import RECORD


class Controller:
    """NPID or one of its peers; the drive is always finite and within ``drive_limit``.

    :param values: parameters by name (`parameters.LAW`); the others have their defaults
    :raises HydraulicError: an unknown name or a value that is not allowed.
    """

    def __init__(self, values: Mapping[str, Any] | None = None) -> None:
        self._values = parameters.complete(values or {})
        self._record = np.zeros(1, RECORD)
        self._state = np.zeros(1, STATE)
        self._write(self._values)

    @property
    def values(self) -> dict[str, Any]:
        """The parameters in use, by name."""
        return dict(self._values)

    @property
    def drive(self) -> float:
        """The last drive [V]."""
        return float(self._state["drive"][0])

    @property
    def records(self) -> tuple[np.ndarray, np.ndarray]:
        """Parameters and state as the compiled step takes them, for loops that are compiled as a whole."""
        return self._record, self._state

    @property
    def running(self) -> bool:
        """Whether it has begun; before, and after `stop`, the next step starts afresh."""
        return bool(self._state["running"][0])

    def set(self, values: Mapping[str, Any]) -> None:
        """Change parameters while running, without a bump in the drive.

        :raises HydraulicError: as the constructor; nothing is changed then.
        """
        changed = self._values | {name: parameters.check(name, value) for name, value in values.items()}
        self._write(changed)
        self._values = changed
        self._state["rebase"] = 1.0

    def stop(self, drive: float = 0.0) -> None:
        """Forget everything; the next step joins on to ``drive`` [V] without a bump."""
        self._state[:] = np.zeros(1, STATE)
        limit = self._values["drive_limit"]
        self._state["drive"] = min(max(drive, -limit), limit) if np.isfinite(drive) else 0.0

    def step(
        self, dt: float, reference: float, reference_velocity: float, position: float, force: float = float("nan")
    ) -> float:
        """Drive [V] for a sample ``dt`` [s] after the last.

        Reference [m], its velocity [m/s], position [m] and force [N] (NaN where not measured).
        """
        return step(self._record, self._state, dt, reference, reference_velocity, position, force)

    def _write(self, values: Mapping[str, Any]) -> None:
        prefix = "pole_placement."
        model = {name.removeprefix(prefix): v for name, v in values.items() if name.startswith(prefix)}
        polynomials = asdict(pole_placement.design(**model))  # may refuse: before anything is written
        for name, value in values.items():
            self._record[name.replace(".", "_")] = parameters.as_number(name, value)
        for name, value in polynomials.items():
            self._record[name] = value
