"""Signs: whether drive, position and pressures point the same way. What else a check compares depends on it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hydraulic_sim.arrays import Array
from hydraulic_sysid.data.display import percent

from .finding import CONTRADICTION, DOUBTFUL, Finding
from .observed import FEWEST, Observed

_AGREE = 0.8  # share of windows in which drive and motion go the same way: null bias and dead time leave most
_OPPOSITE = 0.5  # of the changes of both pressures with the direction, that must add up to a force
SURE = 0.9  # correlation of force and acceleration beyond friction, from which inertia makes most of both


def senses(records: Sequence[Observed]) -> list[list[Finding]]:
    """Of every record: inverted or swapped channels, or a drive that hardly decides where the piston goes."""
    own = [max(pushing(seen), dissipating(seen), key=abs) for seen in records]
    # Not every record shows acceleration or friction; the sensors are those of the others.
    best = max(own, key=abs, default=0.0)
    return [_of_record(seen, one if abs(one) >= SURE else best) for seen, one in zip(records, own, strict=True)]


def _of_record(seen: Observed, together: float) -> list[Finding]:
    agree = drive_agrees(seen)
    inverted = agree is not None and agree < 1.0 - _AGREE
    known, braking = abs(together) >= SURE, together <= -SURE
    inertia = f"force and acceleration (or direction) correlate by {together:.2f}"
    if seen.plant.model.kind == "mechanical":
        if not braking:
            return []
        remedy = "Invert the drive or the position (column map: sign: -1), or correct the sign of drive_force."
        return [_finding(seen, "drive", f"By the sign of drive_force, {inertia}.", remedy, together)]
    against = f"The piston moves against the drive for {percent(1.0 - (agree or 0.0))} of the steady motion"
    if inverted and braking:
        remedy = "Invert the position (column map: sign: -1)."
        return [_finding(seen, "position", f"{against}, and {inertia}.", remedy, agree)]
    if inverted:
        remedy = f"Invert the drive{'' if known else ' or the position'} (column map: sign: -1)."
        return [_finding(seen, "drive", f"{against}.", remedy, agree)]
    if braking:
        remedy = f"Swap the columns of pressure_a and pressure_b{', or invert the position' if agree is None else ''}."
        return [_finding(seen, "pressure_a", f"The pressures push against the motion: {inertia}.", remedy, together)]
    if agree is not None and agree <= _AGREE:
        text = f"Drive and motion have the same sign in {percent(agree)} of the steady motion only."
        remedy = "See that both columns belong to the same axis and the same time."
        return [_finding(seen, "drive", text, remedy, agree, DOUBTFUL)]
    return []


def drive_agrees(seen: Observed) -> float | None:
    """Share of the windows of steady motion in which the piston goes where the drive points; None for too few."""
    flowing = seen.windows.flowing
    if len(flowing) < FEWEST or seen.plant.model.kind == "mechanical":
        return None
    return float(np.mean(flowing.opening * flowing.velocity > 0.0))


def pushing(seen: Observed) -> float:
    """Correlation of force and acceleration, for areas as they are or in each other's place, whichever is clearer."""
    forces = [seen.force]
    if {"pressure_a", "pressure_b"} <= seen.signals.keys():
        a, b = seen.plant.value("piston_area_a"), seen.plant.value("piston_area_b")
        forces.append(b * seen.signals["pressure_a"] - a * seen.signals["pressure_b"])
    parts = [seen.inertia(force) for force in forces]
    return max((correlation(*part) for part in parts if part is not None), key=abs, default=0.0)


def dissipating(seen: Observed) -> float:
    """Correlation of force and direction in steady motion, beyond load and spring: friction takes, and never gives.

    0 where both pressures change alike with the direction: areas that are wrong make any force of that.
    """
    w = seen.windows.flowing
    a, b = (seen.plant.value(f"piston_area_{s}") * getattr(w, f"pressure_{s}") for s in "ab")
    ways = min(np.sum(w.velocity > 0.0), np.sum(w.velocity < 0.0))
    if ways < FEWEST or not np.isfinite(a - b).all():
        return 0.0
    known, _ = np.linalg.qr(np.column_stack((np.ones(len(w)), w.position)))
    both = np.column_stack((a, b, np.sign(w.velocity)))
    a, b, direction = (both - known @ (known.T @ both)).T
    opposite = abs((a - b) @ direction) > _OPPOSITE * (abs(a @ direction) + abs(b @ direction))
    return correlation(a - b, direction) if opposite else 0.0


def correlation(force: Array, acceleration: Array) -> float:
    """Of the two (M,); 0 where one vanishes."""
    size = float(np.linalg.norm(force) * np.linalg.norm(acceleration))
    return float(force @ acceleration) / size if size > 0.0 else 0.0


def _finding(
    seen: Observed, subject: str, text: str, remedy: str, measured: float | None, severity: str = CONTRADICTION
) -> Finding:
    return Finding("sign", subject, severity, text, remedy, measured, None, "1", seen.named)
