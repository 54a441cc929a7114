"""Critical gain and period from a model's frequency response, and the margins of a tuned loop."""

from __future__ import annotations

import control
import numpy as np
from numpy.typing import NDArray

from hydraulic_control.identified import IdentifiedModel
from hydraulic_control.relay import CriticalPoint
from hydraulic_sim.arrays import Complex
from hydraulic_sim.linear import linearise
from hydraulic_sim.model import Model

LOOP_DELAY_S = 1.5e-3
"""From a sample to the middle of the interval over which the drive that answers it acts: one period to get there, half
a period of hold, at 1 kHz."""
_LOWEST, _HIGHEST, _POINTS = 0.05, 3000.0, 6000  # rad/s


def grid(highest: float = _HIGHEST) -> NDArray[np.float64]:
    """Frequencies [rad/s] to look at, up to where a model holds."""
    return np.asarray(np.geomspace(_LOWEST, min(highest, _HIGHEST), _POINTS), dtype=float)


def critical_point(omega: NDArray[np.float64], response: Complex, delay: float = LOOP_DELAY_S) -> CriticalPoint | None:
    """The least gain at which a proportional loop oscillates; None where the phase does not cross −180° on the grid."""
    loop = control.frd(response * np.exp(-1j * omega * delay), omega)
    margins, _, _, crossings, _, _ = control.stability_margins(loop, returnall=True)
    found = [(float(g), float(w)) for g, w in zip(margins, crossings, strict=True) if np.isfinite(g) and g > 0.0]
    if not found:
        return None
    gain, frequency = min(found)
    return CriticalPoint(gain, 2.0 * np.pi / frequency)


def critical_of_model(model: Model) -> CriticalPoint | None:
    """Of the plant linearised at rest in mid stroke, dry friction left out, in a loop at 1 kHz."""
    omega = grid()
    return critical_point(omega, np.asarray(linearise(model)[0, 0](1j * omega), dtype=complex))


def critical_of_identified(model: IdentifiedModel) -> CriticalPoint | None:
    """Of an identified model, up to its Nyquist frequency: beyond it, it cannot tell."""
    omega = grid(model.highest)
    return critical_point(omega, model.response(omega))
