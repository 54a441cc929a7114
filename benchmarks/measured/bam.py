"""Loaded servo pendulums of BAM: XL330, STS3250 and Go1 beside the friction models m1 … m6, by BAM's own measure.

The structure is chosen by the logs for fitting alone: of the effects that `diagnose` adds or lists as nearest there,
those are added, one after the other, that lower the mean absolute error by 2 % on the half of these logs that a fit to
the other half has not seen (both ways). The test logs are run once, at the end. m1 … m6 were identified by `_bam.py` on
the same logs for fitting (`models/bam_m1_to_m6.json`, minutes each) and are run here.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from hydraulic_sim.model import Model
from hydraulic_sim.model_file import load_model, save_model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.data.records import read_all
from hydraulic_sysid.diagnosis.calibrate import calibrate
from hydraulic_sysid.estimation.fit import FitSettings
from measured._bam import DT, Log, bounds, maes, our_maes, our_rollout, polished, read_logs
from measured._bam import MODELS as FRICTION
from measured._bam_motors import MOTORS, Motor
from measured.study import DATA, MODELS, Check, Row, Source, StudyError, Work, said

SOURCE = Source(
    "https://github.com/Rhoban/bam", "af22604", "*.json", "Apache-2.0",
    "M. Duclusaud, G. Passault, V. Padois, O. Ly, Extended Friction Models for the Physics Simulation of Servo "
    "Actuators (2024); logs at af22604 and b53408c, and rimim/bam at 38071b1",
)  # fmt: skip
EXCERPT = DATA / "bam"
QUICK = "sts3250"
SEGMENT, TRIED, WORTH, TRIALS = 1.5, 4, 0.98, 100
KNOWN = {
    "xl330": "a gear, whose friction depends on its load (BAM); whether its supply sags is not known",
    "sts3250": "logged every 20 ms while the goal moves on between: named as a fault of the recording",
    "go1": "what friction it has is not known beyond what BAM fitted",
}

BELOW_M6 = ("xl330", "sts3250")
"""Motors of which the page says that the error is no larger than that of m6."""

Start = Mapping[str, Mapping[str, float]]


def folder(data: Path, motor: Motor) -> Path | None:
    """Where the logs of a motor lie under ``data``: the folder of that name that has logs."""
    found = [p for p in data.rglob(Path(motor.folder).name) if p.is_dir() and any(p.glob("*.json"))]
    return found[0] if found else None


def nearest(document: Mapping) -> Start:
    """The effects that a diagnosis has added or found nearest, best first, with the values that it found."""
    tried = [e for e in document["effects"] if e["refitted"] and e["residual_after"] < e["residual_before"]]
    tried = sorted(tried, key=lambda e: (not e["added"], e["residual_after"]))[:TRIED]
    return {e["name"]: {p["key"]: p["value"] for p in e["parameters"]} for e in tried}


def unseen(model: Model, logs: Sequence[Log], motor: Motor) -> float:
    """Mean absolute error [rad] on each half of the logs of a fit to the other half."""
    halves = logs[0::2], logs[1::2]
    return float(np.mean([our_maes(polished(model, one, motor, TRIALS), other, motor).mean()
                          for one, other in (halves, halves[::-1])]))  # fmt: skip


def chosen(model: Model, candidates: Start, logs: Sequence[Log], motor: Motor, work: Work) -> tuple[Model, list[str]]:
    """The model with those effects that lower the error on logs that the fit has not seen; what was added."""
    best, added, left = unseen(model, logs, motor), [], dict(candidates)
    work.say(f"{motor.name}: {1e3 * best:.2f} mrad on unseen logs for fitting")
    while left:
        trials = {}
        for name, values in left.items():
            richer = model.with_effect(name).with_values(dict(values))
            trials[name] = unseen(richer, logs, motor), richer
            work.say(f"{motor.name}: {1e3 * trials[name][0]:.2f} mrad with {', '.join([*added, name])}")
        name = min(trials, key=lambda n: trials[n][0])
        if trials[name][0] > WORTH * best:
            break
        best, model = trials[name]
        added.append(name)
        del left[name]
    return model, added


def study(data: Path, work: Work) -> list[Row]:
    """A row for each motor whose logs are there; the others are named."""
    rows = []
    for name, motor in MOTORS.items():
        if not work.wanted(name, QUICK):
            continue
        where = folder(data, motor)
        if where is None:
            work.say(f"{name}: no {motor.folder} under {data}: not studied")
            continue
        rows.append(_row(where, motor, work))
    if not rows and (work.machine or QUICK).lower() in MOTORS:
        raise StudyError(f"{data}: logs of no motor; expected {', '.join(m.folder for m in MOTORS.values())}")
    return rows


def _row(where: Path, motor: Motor, work: Work) -> Row:
    logs = read_logs(where)
    fit, test = ([log for log in logs if motor.fitted(log) is role] for role in (True, False))
    path = MODELS / f"{motor.name}.yaml"
    words = ["--model", path, "--record", *(where / f"{log.name}.json" for log in fit), "--columns", motor.columns]
    if not work.quick:
        work.verb("compare", *words, into=f"{motor.name}_compared")
    words += ["--segment", SEGMENT, "--within", 420, *(["--quick"] if work.quick else [])]
    found = work.verb("diagnose", *words, into=f"{motor.name}_diagnosed")
    verdict, evidence = said(found)
    records = read_all([where / f"{log.name}.json" for log in fit], motor.columns)
    base = calibrate(load_model(path), records, settings=FitSettings(length=SEGMENT, robust=True)).model
    richer, added = (base, []) if work.quick else chosen(base, nearest(found), fit, motor, work)
    before = polished(base, fit, motor)
    after = polished(richer, fit, motor) if added else before
    (work.folder / f"{motor.name}_fitted.yaml").unlink(missing_ok=True)
    save_model(after, work.folder / f"{motor.name}_fitted.yaml")
    errors = {w: {r: 1e3 * our_maes(m, ls, motor) for r, ls in (("test", test), ("fit", fit))}
              for w, m in (("before", before), ("after", after))}  # fmt: skip
    identified = json.loads((MODELS / "bam_m1_to_m6.json").read_text("utf-8"))[motor.name]
    theirs = {m: 1e3 * maes(motor.name, identified[m], test).mean() for m in FRICTION}
    mine, free = float(errors["after"]["test"].mean()), len(after.free_keys())
    released = {"position_loop.active": 0.0, "motor_damping.active": 0.0}
    panels = []
    for log in test[:3]:
        goal, at = log.held if motor.held else log.goal, DT * np.arange(log.position.size)
        runs = {"measured": log.position}
        for label, model in (("before", before), ("after", after)):
            runs[label] = our_rollout(Plant(model).with_parameters(motor.settings(log)), log, goal, released)
        panels.append((f"{motor.title}, {log.trajectory}, {log.name}", at, runs))
    work.picture(f"bam_{motor.name}", panels, "rad")
    whole = np.mean(np.concatenate([errors["after"]["test"], errors["after"]["fit"]]))
    return Row(
        motor.title, verdict, evidence, "MAE of position by BAM's measure, test logs [mrad]",
        float(errors["before"]["test"].mean()), mine,
        ", ".join(f"{m} {e:.1f} ({len(bounds(motor.name, m))})" for m, e in theirs.items()),
        f"{KNOWN[motor.name]}; {motor.split}; added {', '.join(added) or 'nothing'}; {free} free parameters; on the "
        f"logs for fitting {errors['after']['fit'].mean():.1f}, on all {whole:.1f} mrad",
        [*([Check(f"{motor.name}: {mine:.1f} ≤ m6's {theirs['m6']:.1f} mrad", bool(mine <= theirs["m6"]))]
           if motor.name in BELOW_M6 else []),
         Check(f"{motor.name}: {free} < {len(bounds(motor.name, 'm6'))} parameters of m6",
               free < len(bounds(motor.name, "m6")))],
    )  # fmt: skip
