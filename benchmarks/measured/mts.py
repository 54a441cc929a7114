"""MTS servo-hydraulic machine in position control against an MR damper: its own loop, and the damper.

The machine: the plant is a lag of order 1 between commanded and measured position, to which `diagnose` may add. A
sweep of 1.4 mm from 0.2 to 20 Hz without current is fitted at 11 to 14 Hz; test data are the sweep with 1 A there,
which nothing else reads. Beside the verdict stands the frequency response, read from the records by hand.

The damper at 1 A: the machine's measured force moves a small mass on viscous and dry friction. Sines of 5 mm at 3 Hz
and 10 mm at 1 Hz are diagnosed; sines of 25 mm at 0.5 Hz and 2 mm at 5 Hz are test data: the force over their
measured motion, by hand, with the nearest effect and with the law that `diagnose --propose` makes of what is left.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from hydraulic_sim.arrays import Array
from hydraulic_sim.effect import arguments
from hydraulic_sim.model import Model
from hydraulic_sim.model_file import load_model
from hydraulic_sim.registry import load_effect
from hydraulic_sysid.data.records import Record, read_all, read_records
from hydraulic_sysid.diagnosis.calibrate import calibrate
from hydraulic_sysid.estimation.fit import FitSettings
from measured.study import DATA, MODELS, Check, Row, Source, StudyError, Work, free_run, rms, said

SOURCE = Source(
    "https://github.com/DanielMaurelE/vRTHS_AMBC_MRdamper", "08753ffd7abd5b19053f7e79149c3a68f49bf73c",
    "0A.txt", "MIT", "vRTHS benchmark with an MR damper, UTFSM Chile (2022)",
)  # fmt: skip
EXCERPT = DATA / "mts"
COLUMNS = "mts_mr_damper"
FIT_WINDOW, TEST_WINDOW, QUICK_WINDOW = (34.0, 44.0), (30.0, 40.0), (34.0, 38.0)
SEGMENT = 0.5

DAMPER_COLUMNS = "mts_mr_damper_force"
DAMPER_FIT, DAMPER_TEST = ("5mm3Hz1A", "10mm1Hz1A"), ("25mm0x5Hz1A", "2mm5Hz1A")
DAMPER_SEGMENT = 0.12  # s: nothing but friction holds the mass, so that an error of the force soon is millimetres


def response(record: Record) -> tuple[float, complex]:
    """Strongest frequency [Hz] of the command and displacement over command there."""
    window = np.hanning(len(record))
    command, position = (np.fft.rfft(window * (record[c] - record[c].mean())) for c in ("drive", "position"))
    k = int(np.argmax(np.abs(command)))
    return k / record.duration, complex(position[k] / command[k])


def by_hand(record: Record) -> tuple[float, float]:
    """Time constant [s] of a lag of order 1 from the gain, and the dead time [s] that the rest of the phase is.

    Means over pieces of 2 s, since the frequency moves.
    """
    found = []
    for begin in np.arange(0.0, record.duration - 2.0, 2.0):
        frequency, gain = response(record.window(begin, begin + 2.0))
        w = 2.0 * np.pi * frequency
        lag = np.sqrt(1.0 / abs(gain) ** 2 - 1.0) / w
        found.append((lag, (-np.angle(gain) - np.arctan(w * lag)) / w))
    lag, dead = np.mean(found, axis=0)
    return float(lag), float(dead)


def study(data: Path, work: Work) -> list[Row]:
    """Machine and damper; quickly, the machine alone, in a shorter window."""
    wanted = [one for one in (machine, damper) if work.wanted(one.__name__, quick="machine")]
    if damper in wanted and not any(data.rglob(f"{DAMPER_FIT[0]}.txt")):
        lacking = f"{data}: no {DAMPER_FIT[0]}.txt in it: the damper is not studied (the excerpt is of the machine)"
        wanted.remove(damper)
        if not wanted:
            raise StudyError(lacking)
        work.say(lacking)
    return [one(data, work) for one in wanted]


def machine(data: Path, work: Work) -> Row:
    """The machine's own position loop."""
    folder = next(data.rglob("0A.txt")).parent
    path = MODELS / "mts.yaml"
    window = QUICK_WINDOW if work.quick else FIT_WINDOW
    (fit,), (test,) = (read_records(folder / f"{name}.txt", COLUMNS) for name in ("0A", "1A"))
    fit, test = fit.window(*window), test.window(*TEST_WINDOW)
    words = ["--model", path, "--record", folder / "0A.txt", "--columns", COLUMNS, "--window", *window]
    if not work.quick:
        work.verb("compare", *words, into="compared")
    found = work.verb("diagnose", *words, "--segment", SEGMENT, "--within", 280, "--apply", into="diagnosed")
    verdict, evidence = said(found)
    named = list(found["verdict"]["effects"])
    instead = {c["name"] for name in named for c in found["competing_models"].get(name, []) if not c["distinguishable"]}
    bare = calibrate(load_model(path), [fit], settings=FitSettings(length=SEGMENT)).model
    delayed = calibrate(bare.with_effect("command_delay"), [fit], settings=FitSettings(length=SEGMENT)).model
    runs: dict[str, Array] = {"before": free_run(bare, test), "after": free_run(delayed, test)}
    before, after = (1e3 * rms(y - test["position"]) for y in runs.values())
    lag, dead = by_hand(fit)
    delay, fitted_lag = delayed.value("command_delay.delay"), _lag(delayed)
    shown = test.window(0.0, 0.5)
    panel = {"measured": shown["position"], **{k: v[: len(shown)] for k, v in runs.items()}}
    work.picture("mts", [("1 A, 0.5 s of the test record", shown.time, {k: 1e3 * v for k, v in panel.items()})], "mm")
    return Row(
        "MTS machine", verdict + (f"; not distinguishable: {', '.join(sorted(instead))}" if instead else ""), evidence,
        "RMSE of displacement in free run, 1 A [mm], before and with command_delay", before, after,
        "17 ms, cross-correlation of command and displacement over all of the sweep: lag and dead time together",
        f"by hand, from the frequency response: lag {1e3 * lag:.1f} ms and dead time {1e3 * dead:.1f} ms; fitted lag "
        f"{1e3 * fitted_lag:.1f} ms, dead time {1e3 * delay:.2f} ms; what the valve is, is not known",
        [Check(f"command_delay is named or not distinguishable from what is: {named}, {sorted(instead)}",
               "command_delay" in {*named, *instead}),
         Check(f"dead time {1e3 * delay:.2f} ms within 1.5 ms of {1e3 * dead:.2f} ms by hand",
               abs(delay - dead) < 1.5e-3),
         Check(f"{before:.4f} → {after:.4f} mm: falls by a quarter or more", after < 0.75 * before)],
    )  # fmt: skip


def _lag(model: Model) -> float:
    """Time constant [s] of the model's loop: damping over stiffness."""
    stiffness = model.value("position_loop.gain") * model.value("drive_force") * model.value("drive_limit")
    return model.value("viscous_friction.coefficient") / stiffness


def damper(data: Path, work: Work) -> Row:
    """The MR damper by the force that moves it."""
    path = MODELS / "mr_damper.yaml"
    to_fit, to_test = ([next(data.rglob(f"{name}.txt")) for name in names] for names in (DAMPER_FIT, DAMPER_TEST))
    fit, tests = (read_all(files, DAMPER_COLUMNS) for files in (to_fit, to_test))
    words = ["--model", path, "--record", *to_fit, "--columns", DAMPER_COLUMNS, "--segment", DAMPER_SEGMENT]
    law = work.folder / "hysteresis.py"
    law.unlink(missing_ok=True)
    found = work.verb("diagnose", *words, "--propose", law, into="damper_diagnosed")
    _, evidence = said(found)
    kind = found["verdict"]["kind"]
    nearest, proposed = found["verdict"]["effects"], found["proposed_effect"] or {}
    bare = calibrate(load_model(path), fit, settings=FitSettings(length=DAMPER_SEGMENT)).model
    added = work.verb("add", "presliding", *words, into="damper_added")
    joined = work.verb("add", law, *words, "--holdout", *to_test, into="damper_joined")
    values = {"viscous and dry": {key: bare.value(key) for key in bare.free_keys()}}
    for name, document in (("presliding", added), ("proposed law", joined)):
        values[name] = {p["key"]: p["value"] for p in document["parameters"]}
    loops = [{"measured": r["force"]} | {name: force(r, own, law) for name, own in values.items()} for r in tests]
    off = {name: rms(np.concatenate([own[name] - own["measured"] for own in loops])) for name in values}
    shown = ("measured", "viscous and dry", "proposed law")
    work.picture("mr_damper", [(f"{name}, a test record", r.time, {k: own[k] for k in shown})
                               for name, r, own in zip(DAMPER_TEST, tests, loops, strict=True)], "N")  # fmt: skip
    before, turned, after = off.values()
    left = {which: joined["test"][which] for which in ("before", "after")}
    lag = values["proposed law"].get("hysteresis.lag", 0.0)
    return Row(
        "MR damper at 1 A", f"{kind}: nearest {', '.join(nearest)}", evidence,
        "RMSE of the force over measured test motions, by hand [N], before and with the proposed law", before, after,
        "hysteretic, a Bouc-Wen law; no error is published",
        f"the law proposed: {proposed.get('law')} over the {proposed.get('variable')}, {1e3 * lag:.1f} ms late, which "
        f"explains {proposed.get('explained_share', 0.0):.0%} of what is left; with presliding, "
        f"{1e3 * values['presliding']['presliding.length']:.2f} mm, {turned:.0f} N",
        [Check(f"the verdict is outside the library: {kind}", kind == "outside the library"),
         Check(f"the nearest effect is hysteretic: {nearest}", nearest == ["presliding"]),
         Check(f"the law proposed is hysteretic: {proposed.get('variable')}",
               proposed.get("variable") == "lagged_velocity"),
         Check(f"{before:.0f} → {turned:.0f} N with presliding: falls by a quarter or more", turned < 0.75 * before),
         Check(f"{before:.0f} → {after:.0f} N with the law: falls by two fifths or more", after < 0.6 * before),
         Check(f"test motions leave {left['before']:.2f} → {left['after']:.2f} × noise: falls",
               left["after"] < left["before"])],
    )  # fmt: skip


def force(record: Record, values: dict[str, float], law: Path) -> Array:
    """Force (N,) [N] that moves the damper as it was measured to move, by the laws with these values.

    Presliding is dz/dt = |v|/δ (sign v − z), F = Fc (z + τ dz/dt), never beyond Fc; without it F = Fc sign v. The
    ``law`` proposed, where there are values of it, is over dz/dt = (v − z)/lag.
    """
    v = np.gradient(record["position"], record.dt)
    moved = values["moving_mass"] * np.gradient(v, record.dt) + values["viscous_friction.coefficient"] * v
    level, length = values["coulomb_friction.level"], values.get("presliding.length", 0.0)
    if f"{law.stem}.lag" in values:
        late = followed(v, np.full(v.shape, record.dt / values[f"{law.stem}.lag"]))
        kernel = load_effect(law).effect.kernel
        own = {name: values.get(f"{law.stem}.{name}", 0.0) for name in arguments(kernel)}
        moved -= [kernel(**{**own, "lagged_velocity": z}) for z in late.tolist()]
    if not length:
        return np.asarray(moved + level * np.sign(v))
    z = followed(np.sign(v), np.abs(v) * record.dt / length)
    turned = z + values["presliding.time"] * np.gradient(z, record.dt)
    return np.asarray(moved + level * np.clip(turned, -1.0, 1.0))


def followed(aim: Array, steps: Array) -> Array:
    """What follows ``aim`` (N,) by a lag of order 1; ``steps`` (N,): sampling intervals over its time constant."""
    z, found = float(aim[0]), np.empty_like(aim)
    for k, (to, step) in enumerate(zip(aim.tolist(), steps.tolist(), strict=True)):
        z = to + (z - to) * np.exp(-step)
        found[k] = z
    return found
