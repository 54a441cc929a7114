"""Festo TP511 axis: open loop from stop to stop, one pressure a run; the author's model has viscous friction only.

The friction is read by hand from two runs of one command, of which one has pressure A and the other pressure B:
p_A·A_A − p_B·A_B, the mean over the middle of the stroke, where the speed is steady. The records have no licence:
nothing of them is shipped. Fitted are runs 3 at 1 and 5 V; test data are runs 6 at 2 and 4 V, run over mid stroke.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from hydraulic_sim.model import Model
from hydraulic_sim.model_file import load_model
from hydraulic_sysid.data.records import Record, read_records
from hydraulic_sysid.data.records.paired import paired
from hydraulic_sysid.diagnosis.calibrate import calibrate
from hydraulic_sysid.estimation.fit import FitSettings
from measured.study import MODELS, Check, Row, Source, Work, free_run, rms, said

SOURCE = Source(
    "https://github.com/ingxfm/find-the-viscous-friction-value-from-a-bunch-of-.mat-data-files", "HEAD",
    "m_find_b_pA_3V_sample_3.mat", "none: not shipped", "data/*.mat; 100 records of 10 kHz",
)  # fmt: skip
EXCERPT = None
COLUMNS, VOLTS, MIDDLE = "festo_tp511", (1, 2, 3, 4, 5), 0.05  # m on either side of mid stroke
FIT, TEST = ((1, 3), (5, 3)), ((2, 6), (4, 6))  # (volts, run)
OUT, BACK = (62.0, 70.0), (73.0, 81.0)  # N, force by hand that was seen before


def path(folder: Path, volts: int, run: int, chamber: str) -> Path:
    return folder / f"m_find_b_p{chamber}_{volts}V_sample_{run}.mat"


def read(folder: Path, volts: int, run: int, chamber: str) -> Record:
    (record,) = read_records(path(folder, volts, run, chamber), COLUMNS)
    return record


def strokes(record: Record) -> list[slice]:
    """Where the piston goes through the middle of the stroke, out and back."""
    smooth = np.convolve(record["position"], np.full(201, 1.0 / 201), mode="same")
    inside = np.abs(smooth) < MIDDLE
    edges = np.flatnonzero(np.diff(np.r_[0, inside.astype(int), 0]))
    return [slice(a, b) for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a > 0.1 / record.dt]


def forces(folder: Path, volts: int, run: int, model: Model) -> list[tuple[float, float]]:
    """Speed [m/s] and force of the pressures [N] of each stroke."""
    a, b = read(folder, volts, run, "A"), read(folder, volts, run, "B")
    area_a, area_b = model.value("piston_area_a"), model.value("piston_area_b")
    found = []
    for one, other in zip(strokes(a), strokes(b), strict=True):
        speed = float(np.polyfit(a.time[one], a["position"][one], 1)[0])
        at_a, at_b = float(a["pressure_a"][one].mean()), float(b["pressure_b"][other].mean())
        found.append((speed, area_a * at_a - area_b * at_b))
    return found


def error(model: Model, records: list[Record]) -> float:
    """RMSE [mm] of free runs over the middle of the stroke, a stroke at a time from where it was measured."""
    off = []
    for record in records:
        for stroke in strokes(record):
            first, last = (float(record.time[k] - record.time[0]) for k in (stroke.start, stroke.stop - 1))
            part = record.window(first, last)
            off.append(free_run(model, part) - part["position"])
    return 1e3 * rms(np.concatenate(off))


def friction_picture(seen: list[tuple[float, float]], viscous: Model, dry: Model, work: Work) -> None:
    """Force of the pressures over speed beside the laws; means alone, nothing sample by sample."""
    speed, force = np.array(sorted(seen)).T
    laws = {
        "viscous only, as in the model file": viscous.value("viscous_friction.coefficient") * speed,
        "fitted with coulomb_friction": dry.value("viscous_friction.coefficient") * speed
        + dry.value("coulomb_friction.level") * np.sign(speed),
    }
    work.picture("tp511", [("mean force of the pressures", speed, {"by hand": force, **laws})], "N", "m/s")


def study(data: Path, work: Work) -> list[Row]:
    folder = next(data.rglob("m_find_b_pA_3V_sample_3.mat")).parent
    bare = load_model(MODELS / "tp511.yaml")
    seen = [pair for volts in VOLTS for pair in forces(folder, volts, FIT[0][1], bare)]
    out = sorted(abs(f) for v, f in seen if v > 0.0)
    back = sorted(abs(f) for v, f in seen if v < 0.0)
    files = [path(folder, *which, chamber) for which in FIT for chamber in "AB"]
    words = ["--model", MODELS / "tp511.yaml", "--record", *files, "--columns", COLUMNS]
    found = work.verb("diagnose", *words, "--within", 400, into="diagnosed")
    verdict, evidence = said(found)
    test = [read(folder, *which, "A") for which in TEST]
    fit = paired([read(folder, *which, chamber) for which in FIT for chamber in "AB"])  # as every verb reads them
    settings = FitSettings(length=0.5)
    before = calibrate(bare, fit, settings=settings).model
    after = calibrate(before.with_effect("coulomb_friction").with_values({"coulomb_friction.level": 60.0}), fit,
                      settings=settings).model  # fmt: skip
    errors = error(before, test), error(after, test)
    level, viscous = after.value("coulomb_friction.level"), after.value("viscous_friction.coefficient")
    friction_picture(seen, bare, after, work)
    named = {"coulomb_friction", "stribeck_friction"} & set(found["verdict"]["effects"])  # dry, both
    return [Row(
        "Festo TP511", verdict, evidence, "position in free run over mid stroke, before and with coulomb_friction [mm]",
        *errors, "the author states viscous friction only",
        f"pressures by hand: {out[0]:.0f}–{out[-1]:.0f} N extending, {back[0]:.0f}–{back[-1]:.0f} N retracting; fitted "
        f"with coulomb_friction: {level:.0f} N and {viscous:.0f} N s/m",
        [Check(f"{out[0]:.0f}–{out[-1]:.0f} N extending within {OUT}",
               OUT[0] - 0.5 <= out[0] and out[-1] <= OUT[1] + 0.5),
         Check(f"{back[0]:.0f}–{back[-1]:.0f} N retracting within {BACK}",
               BACK[0] - 0.5 <= back[0] and back[-1] <= BACK[1] + 0.5),
         Check("diagnose names dry friction", bool(named))],
    )]  # fmt: skip
