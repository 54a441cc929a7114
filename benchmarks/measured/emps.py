"""EMPS, a ball-screw axis under a PD controller: the symmetric friction of its published model, and what that lacks.

Force is judged as the benchmark does, by inverse dynamics: position filtered at 100 Hz (Butterworth of order 4, both
ways), central differences, decimation by 10, least squares, and the norm of what is left over that of the force.
The last third of the record is test data of that fit; `diagnose` gets all of the record, from the published values on.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy import signal

from hydraulic_sim.arrays import Array
from hydraulic_sysid.data.records import read_records
from measured.study import MODELS, Check, Row, Source, Work, rms, said

SOURCE = Source(
    "https://github.com/wmkouw/NSI-EMPS", "main", "DATA_EMPS.mat", "of the data themselves: none is stated",
    "A. Janot, M. Gautier, M. Brunot, Data Set and Reference Models of EMPS (2019)",
)  # fmt: skip
EXCERPT = None
BAND, EVERY, EDGE = 100.0, 10, 30
SYMMETRIC, ASYMMETRIC = 4.0834, 3.1117  # per cent of the force, published


def derivatives(position: Array, dt: float) -> tuple[Array, Array, Array]:
    """Filtered position, velocity and acceleration (N,)."""
    smooth = signal.filtfilt(*signal.butter(4, 2.0 * BAND * dt), position)
    velocity = np.gradient(smooth, dt)
    return smooth, velocity, np.gradient(velocity, dt)


def regressors(position: Array, dt: float) -> Array:
    """(N, 5): of mass, viscous, dry and constant force, and last of a viscous friction that depends on direction."""
    _, v, a = derivatives(position, dt)
    return np.stack([a, v, np.sign(v), np.ones_like(v), np.abs(v)], axis=1)


def decimated(columns: Array) -> Array:
    return np.asarray(signal.decimate(columns, EVERY, axis=0, zero_phase=True))[EDGE:-EDGE]


def left(laws: Array, force: Array, fitted: slice, judged: slice) -> tuple[float, Array]:
    """Per cent of the force that a least-squares fit leaves on other samples, and the fit's values."""
    values, *_ = np.linalg.lstsq(laws[fitted], force[fitted], rcond=None)
    return 100.0 * rms(force[judged] - laws[judged] @ values) / rms(force[judged]), values


def study(data: Path, work: Work) -> list[Row]:
    path = next(data.rglob("DATA_EMPS.mat"))
    (record,) = read_records(path, "emps")
    laws, force = decimated(regressors(record["position"], record.dt)), decimated(record["force"])
    everything, third = slice(None), 2 * len(force) // 3
    whole = [left(laws[:, :n], force, everything, everything) for n in (4, 5)]
    held = [left(laws[:, :n], force, slice(third), slice(third, None)) for n in (4, 5)]
    words = ["--model", MODELS / "emps.yaml", "--record", path, "--columns", "emps"]
    work.verb("compare", *words, into="compared")
    found = work.verb("diagnose", *words, "--within", 150, into="diagnosed")
    verdict, evidence = said(found)
    added = work.verb("add", "viscous_asymmetry", *words, into="added")
    effect = {p["key"]: p["value"] for p in added["parameters"]}.get("viscous_asymmetry.difference", float("nan"))
    by_add = " → ".join(f"{added['residual'][when]['validation']:.3g}" for when in ("before", "after"))
    at = record.dt * EVERY * np.arange(len(force))
    curves = {"measured": force, **{k: laws[:, :n] @ w[1] for k, n, w in
                                    (("before", 4, held[0]), ("after", 5, held[1]))}}  # fmt: skip
    shown = slice(third, None)
    work.picture("emps", [("test data: the last third", at[shown], {k: v[shown] for k, v in curves.items()})], "N")
    return [Row(
        "EMPS axis", verdict, evidence, "force by inverse dynamics, last third of the record [%]", held[0][0],
        held[1][0],
        f"{SYMMETRIC:.2f} % symmetric, {ASYMMETRIC:.2f} % with the effect that the authors name, both over all of it",
        f"over all of the record {whole[0][0]:.2f} % and {whole[1][0]:.2f} % with viscous friction that depends on "
        f"direction ({whole[1][1][4]:.1f} N s/m); `add viscous_asymmetry`: {by_add} × noise, {effect:.1f} N s/m",
        [Check(f"{whole[1][0]:.2f} ≤ {ASYMMETRIC:.2f} % with direction-dependent friction", whole[1][0] <= ASYMMETRIC),
         Check(f"{held[1][0]:.2f} < {held[0][0]:.2f} % on test data", held[1][0] < held[0][0]),
         Check("diagnose names viscous_asymmetry", "viscous_asymmetry" in found["verdict"]["effects"])],
    )]  # fmt: skip
