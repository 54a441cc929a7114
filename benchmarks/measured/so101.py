"""SO-101 arm: six servo joints; gravity, dead time and backlash beside `mujoco.sysid` on the same motions.

Fitted to multisine, friction_gravity and backlash_detection, tested in free run on chirp_sweep, step_response and
random_waypoints, the first 40 s of each. The structure is what `diagnose` names, or what comes nearest where it names
nothing; of effects that it cannot distinguish, the one whose free run over the motions for fitting is nearest. No test
motion has a say. The figures of `mujoco.sysid` are those of `_mujoco_joint.py` over the same samples
(`models/so101_mujoco.json`): it needs an interpreter of its own and does not run here.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from hydraulic_sim.model import Model
from hydraulic_sim.model_file import load_model
from hydraulic_sysid.data.records import Record, read_records
from hydraulic_sysid.diagnosis.calibrate import calibrate
from hydraulic_sysid.estimation.fit import FitSettings
from measured.study import DATA, MODELS, Check, Row, Source, Work, free_run, rms, said

SOURCE = Source(
    "https://github.com/isaac-sim2real/sage", "4ffd2627df9d23e279b35712a67e629ce0c0dfa7", "multisine/control.csv",
    "Apache-2.0", "SAGE, output/real/so101: 50 motions of an SO-101 arm, 50 Hz",
)  # fmt: skip
EXCERPT = DATA / "so101"
FIT = ("multisine", "friction_gravity", "backlash_detection")
TEST = ("chirp_sweep", "step_response", "random_waypoints")
SECONDS, QUICK_SECONDS, SEGMENT = 40.0, 15.0, 1.5
QUICK = "elbow"
JOINTS = {"pitch": "gravity_pendulum", "elbow": "gravity_pendulum", "rotation": None}
"""Joint → what is known of it: the weight of an arm; the axis of the rotation is vertical."""

BESIDE = (("a dead time", "sensor_delay.delay", "ms"), ("a gap", "sensor_backlash.half_gap", "mrad"))


def motion(folder: Path, name: str, joint: str, seconds: float = SECONDS) -> Record:
    """The first seconds of one joint in one motion."""
    (record,) = read_records(folder / name / "control.csv", f"so101_{joint}")
    return record.window(0.0, seconds) if record.duration > seconds + 0.1 else record


def fitted(model: Model, records: list[Record]) -> Model:
    return calibrate(model, records, settings=FitSettings(length=SEGMENT)).model


def sizes(model: Model, records: list[Record]) -> Iterator[str]:
    """What else the motions were made for, each fitted beside the model: its size and standard error."""
    for words, key, unit in BESIDE:
        name = key.partition(".")[0]
        done = calibrate(model.with_effect(name), records, settings=FitSettings(length=SEGMENT)).result
        (found,) = (p for p in done["parameters"] if p["key"] == key)
        times = 2e3 if name == "sensor_backlash" else 1e3
        yield f"{words} of {times * found['value']:.2f} ± {times * found['standard_error']:.2f} {unit}"


def first_and_tied(found: Mapping[str, Any]) -> list[str]:
    """The effect that a diagnosis names first, or finds nearest, and those from which it cannot distinguish it."""
    if not found["verdict"]["effects"]:
        return []
    first = found["verdict"]["effects"][0]
    return [first, *(c["name"] for c in found["competing_models"].get(first, ()) if not c["distinguishable"])]


def mean_rms(model: Model, records: list[Record]) -> float:
    return float(np.mean([rms(free_run(model, r) - r["position"]) for r in records]))


def study(data: Path, work: Work) -> list[Row]:
    """Each joint; quickly the elbow alone, by 15 s of two motions."""
    folder = next(data.rglob(SOURCE.files)).parent.parent
    rows = []
    for joint, known in JOINTS.items():
        if not work.wanted(joint, QUICK):
            continue
        used, seconds = (FIT[:2], QUICK_SECONDS) if work.quick else (FIT, SECONDS)
        fit = [motion(folder, name, joint, seconds) for name in used]
        test = [motion(folder, name, joint) for name in TEST]
        bare = load_model(MODELS / "so101.yaml")
        words = ["--model", MODELS / "so101.yaml", "--record", *(folder / n / "control.csv" for n in used)]
        words += ["--columns", f"so101_{joint}", "--window", 0, seconds]
        if not work.quick:
            work.verb("compare", *words, into=f"{joint}_compared")
        words += ["--segment", SEGMENT, "--within", 300, *(["--quick"] if work.quick else [])]
        found = work.verb("diagnose", *words, into=f"{joint}_diagnosed")
        verdict, evidence = said(found)
        possible = first_and_tied(found)
        before = fitted(bare, fit)
        every = {name: fitted(bare.with_effect(name), fit) for name in possible}
        named = min(every, key=lambda name: mean_rms(every[name], fit), default=None)
        after = every[named] if named else before
        runs = {which: [free_run(m, r) for r in test] for which, m in (("before", before), ("after", after))}
        errors = {k: [1e3 * rms(y - r["position"]) for y, r in zip(v, test, strict=True)] for k, v in runs.items()}
        mean = {which: float(np.mean(values)) for which, values in errors.items()}
        own = json.loads((MODELS / "so101_mujoco.json").read_text("utf-8"))[joint]
        theirs = 1e3 * float(np.mean([own["rmse"][f"test.{name}"] for name in TEST]))
        said_so = known in possible if known else not possible
        checks = [
            Check(f"{joint}: {known or 'no load'} is named or nearest", said_so),
            Check(f"{joint}: {mean['after']:.1f} ≤ 0.9 × {theirs:.1f} mrad", mean["after"] <= 0.9 * theirs),
        ]
        if known:
            checks.append(Check(f"{joint}: {mean['before']:.1f} falls to less than half, {mean['after']:.1f} mrad",
                                mean["after"] < 0.5 * mean["before"]))  # fmt: skip
        beside = "" if work.quick else f"; beside it, fitted alone: {', '.join(sizes(after, fit))}"
        free = len(after.free_keys())
        rows.append(Row(
            f"SO-101 {joint}", verdict, evidence, "RMSE of position in free run, mean of 3 test motions [mrad]",
            mean["before"], mean["after"], f"mujoco[sysid] {own['version']}: {theirs:.1f} ({own['free']} parameters)",
            f"{'an arm that gravity pulls' if known else 'a vertical axis, no gravity'}; {free} free parameters; "
            f"each test motion: {', '.join(f'{n} {e:.1f}' for n, e in zip(TEST, errors['after'], strict=True))} mrad"
            f"{beside}",
            checks,
        ))  # fmt: skip
        panels = [
            (f"{joint}, {name}", r.time, {"measured": r["position"], **{k: v[i] for k, v in runs.items()}})
            for i, (name, r) in enumerate(zip(TEST, test, strict=True))
        ]
        work.picture(f"so101_{joint}", panels, "rad")
    return rows
