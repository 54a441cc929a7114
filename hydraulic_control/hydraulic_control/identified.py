"""An identified transfer function as a plant of the loop: run at the controller's rate, whatever its own.

A model sampled with a zero-order hold of T is brought to continuous time mode by mode, s = ln(z)/T, which keeps its
response at its own sampling instants exactly (K. J. Åström, B. Wittenmark, Computer-Controlled Systems, 3rd ed. 1997,
sec. 2.3). Between them, and above its Nyquist frequency, it knows nothing of the plant.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hydraulic_control.compiled_loop import linear
from hydraulic_control.controller import Controller
from hydraulic_control.errors import ControlError
from hydraulic_node_utils.json_file import read_json

_APART = 1e-9
_COMMON_NAMES = ("identify", "linear_model")  # all results are called so: their folder tells them apart


@dataclass(frozen=True)
class IdentifiedModel:
    """Modes of a transfer function from the drive [V] to the position [m]: y = Σ c/(s − p)·u + d·u, ``delay`` [s] late.

    ``poles`` (n,) [rad/s], ``residues`` (n,), ``direct`` [m/V]; ``highest`` [rad/s] is the frequency up to which it
    holds (infinite for a continuous model); ``name`` says where it is from.
    """

    name: str
    poles: NDArray[np.complex128]
    residues: NDArray[np.complex128]
    direct: float
    delay: float
    highest: float

    def response(self, omega: ArrayLike) -> NDArray[np.complex128]:
        """Frequency response [m/V] at ``omega`` [rad/s], (N,)."""
        s = 1j * np.atleast_1d(np.asarray(omega, dtype=float))[:, None]
        # A real pole at z < 0 becomes a complex one alone; with its conjugate the response stays that of a real system.
        both = self.residues / (s - self.poles) + self.residues.conj() / (s - self.poles.conj())
        return (0.5 * both.sum(axis=1) + self.direct) * np.exp(-s[:, 0] * self.delay)

    @property
    def velocity_gain(self) -> float:
        """Speed per volt [m/(s·V)] of the slowest mode, which is the integrator of an actuator."""
        slowest = int(np.argmin(np.abs(self.poles)))
        return float(self.residues[slowest].real)

    def close_loop(self, controller: Controller, wanted: NDArray, dt: float) -> tuple[NDArray, int]:
        """See `simulation.LoopPlant`; from rest at 0 m, compiled. It has no chambers: the force is not a number."""
        turn = np.exp(self.poles * dt)
        fast = np.abs(self.poles) * dt > _APART
        push = np.where(fast, (turn - 1.0) / np.where(fast, self.poles, 1.0), dt).astype(complex)
        out, late = np.empty((len(wanted), 2)), round(self.delay / dt)
        return out, linear(turn, push, self.residues, self.direct, late, *controller.compiled, dt, wanted, out)


def from_coefficients(
    numerator: ArrayLike, denominator: ArrayLike, sampling_time: float | None, delay: float = 0.0, name: str = "model"
) -> IdentifiedModel:
    """Model of a transfer function in descending powers of z, sampled every ``sampling_time`` [s].

    Without a sampling time (None or 0) they are powers of s.

    :raises ControlError: coefficients that are no proper transfer function, or repeated poles.
    """
    num, den = (np.trim_zeros(np.atleast_1d(np.asarray(c, dtype=float)), "f") for c in (numerator, denominator))
    if not (len(num) and len(den) >= 2 and len(num) <= len(den) and np.isfinite([*num, *den]).all()):
        raise ControlError(
            f"{name}: numerator {list(num)} over denominator {list(den)} is no proper transfer function with poles"
        )
    if not (math.isfinite(delay) and delay >= 0.0):
        raise ControlError(f"{name}: the delay is {delay} s; it must not be negative")
    poles = np.roots(den).astype(complex)
    distances = np.abs(poles[:, None] - poles[None, :]) + np.diag(np.full(len(poles), np.inf))
    if distances.min() < _APART * max(1.0, float(np.abs(poles).max())):
        raise ControlError(f"{name}: has a repeated pole ({poles}); only simple poles can be taken apart")
    direct = float(num[0] / den[0]) if len(num) == len(den) else 0.0
    residues = (np.polyval(num, poles) / np.polyval(np.polyder(den), poles)).astype(complex)
    if not sampling_time:
        return IdentifiedModel(name, poles, residues, direct, delay, math.inf)
    poles, residues = _continuous(poles, residues, sampling_time, name)
    return IdentifiedModel(name, poles, residues, direct, delay, math.pi / sampling_time)


def _continuous(z: NDArray, residues: NDArray, period: float, name: str) -> tuple[NDArray, NDArray]:
    """Modes r/(q − z) under a zero-order hold as modes c/(s − p): p = ln(z)/T, c = r·p/(z − 1)."""
    # A pole at z = 0 is a pure delay of one sample, which has no logarithm: it decays within a thirtieth of one.
    z = np.where(np.abs(z) < 1e-13, 1e-13, z)
    s = np.log(z) / period
    slow = np.abs(z - 1.0) < _APART
    gain = np.where(slow, 1.0 / period, s / np.where(slow, 1.0, z - 1.0))
    if not np.isfinite(period) or period < 0.0:
        raise ControlError(f"{name}: the sampling time is {period} s; it must be positive")
    return s, residues * gain


def load_identified(path: Path | str) -> IdentifiedModel:
    """The model in a JSON file, as ``hydraulic_sysid identify`` writes it or alike.

    The file holds numerator, denominator, sampling_time [s], domain (discrete or continuous) and, if there is one,
    delay [s].

    :raises ControlError: a file that cannot be read or holds no transfer function from V to m.
    """
    file = Path(path)
    try:
        document = form = read_json(file, ControlError)
        _check_units(file, document)
        for key in ("model", "transfer_function"):
            form = form.get(key, form)
        continuous = form.get("domain", "discrete") == "continuous"
        period = None if continuous else form.get("sampling_time")
        name = file.absolute().parent.name if file.stem in _COMMON_NAMES else file.stem
        return from_coefficients(form["numerator"], form["denominator"], period, form.get("delay") or 0.0, name)
    except (AttributeError, KeyError, TypeError) as error:
        raise ControlError(f"{file}: holds no transfer function ({error})") from None


def _check_units(file: Path, document: dict[str, Any]) -> None:
    settings = document.get("settings", document)
    for side, unit in (("input", "V"), ("output", "m")):
        found = settings.get(side, {}).get("unit", unit)
        if found != unit:
            raise ControlError(f"{file}: its {side} is in {found}; a position loop needs one in {unit}")
