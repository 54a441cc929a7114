"""What a diagnosis is worth to the controller: a sine tracked before and after it, beside the best PID.

    python benchmarks/model_inversion.py [--plants 24] [--seed 77] [--picture FILE.html]

A bench hides a dead band of the valve and more dry friction than its model file knows. `diagnose` gets three noisy
records of it and the model file; nothing else passes from the bench to the controller. Then scattered copies of that
bench follow a sine of 0.5 Hz: with the shipped PID and NPID, with the inversion of the model file as it was, and of the
model that the diagnosis wrote. Printed are RMS errors and their ratios.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from hydraulic_control import gains_file
from hydraulic_control.response import Response, tracking_figures
from hydraulic_control.scenario import scattered_models
from hydraulic_control.simulation import SensorNoise
from hydraulic_control.trials import TRIALS
from hydraulic_sim.model import Model
from hydraulic_sim.model_file import load_model, save_model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.diagnosis.search import diagnose

PRESET = "moog_mcr_m_1002_bench"
HIDDEN = {"valve_deadband": {"width": 0.03}}
FRICTION = {"coulomb_friction.level": 1500.0}
RATE, SECONDS = 1000.0, 15.0
SIZES = (0.05, 0.02)
BEST_PID, BEFORE = 1.0 / 3.0, 0.5
"""Parts of the error of the PID, and of the error before the diagnosis, that are to be had."""


def bench(model: Model) -> Model:
    """The model file's actuator as it really is."""
    for name, values in HIDDEN.items():
        model = model.with_effect(name, values)
    return model.with_values(FRICTION)


def records(true: Model, seed: int) -> list[Record]:
    """A chirp, tones and steps, as noisy sensors show them."""
    generator, noise = np.random.default_rng(seed), SensorNoise()
    t = np.arange(round(SECONDS * RATE)) / RATE
    chirp = 1.5 * np.sin(2.0 * np.pi * (0.2 * t + 0.5 * (8.0 - 0.2) / SECONDS * t**2))
    tones = sum(0.7 * np.sin(2.0 * np.pi * f * t + generator.uniform(0.0, 6.0)) for f in (0.3, 1.1, 4.0))
    steps = np.repeat(generator.uniform(-2.0, 2.0, round(SECONDS / 0.5)), round(0.5 * RATE))
    found = []
    for name, drive in (("chirp", chirp), ("tones", tones), ("steps", steps - steps.mean())):
        run = Plant.at_rate(true, RATE).simulate(drive, 1.0 / RATE)
        position = run.position + noise.position * generator.standard_normal(len(t))
        channels = {"drive": run.drive, "position": np.round(position / noise.resolution) * noise.resolution}
        for key in ("pressure_a", "pressure_b"):
            channels[key] = run[key] + noise.pressure * generator.standard_normal(len(t))
        found.append(Record(name, t, 1.0 / RATE, channels))
    return found


def errors(values: dict[str, Any], plants: list[Model], size: float) -> tuple[np.ndarray, Response]:
    """RMS error [mm] on each plant, and the response of the first."""
    done = [TRIALS["sine"].response(values, one, size, SensorNoise(), i) for i, one in enumerate(plants)]
    return np.array([1e3 * tracking_figures(one).rms_error for one in done]), done[0]


def main() -> int:
    """Run and print; 1 where a ratio is not reached."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--plants", type=int, default=24)
    parser.add_argument("--seed", type=int, default=77, help="of records and plants")
    parser.add_argument("--picture", type=Path, help="page with the errors over time")
    options = parser.parse_args()
    known = load_model(PRESET)
    true = bench(known)
    done = diagnose(known, records(true, options.seed))
    print(done.result["verdict"]["text"])
    plants = [true, *scattered_models(true, options.plants, options.seed)]
    reached = True
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "diagnosed.yaml"
        save_model(done.model, file)
        inversion = gains_file.load("model_inversion")
        controllers = {
            "pid": gains_file.load("pid"),
            "npid": gains_file.load("npid"),
            "inversion before": inversion,
            "inversion after": {**inversion, "model_inversion.model": str(file)},
        }
        curves = {}
        for size in SIZES:
            found = {name: errors(values, plants, size) for name, values in controllers.items()}
            print(f"\nsine of 0.5 Hz, {1e3 * size:g} mm, {options.plants} scattered copies: RMS error [mm]")
            for name, (error, _) in found.items():
                copies = f"median {np.median(error[1:]):7.4f}  worst {error[1:].max():7.4f}"
                print(f"  {name:18s} bench {error[0]:7.4f}  {copies}")
            after = np.median(found["inversion after"][0][1:])
            best = min(np.median(found[name][0][1:]) for name in ("pid", "npid"))
            before = np.median(found["inversion before"][0][1:])
            print(f"  after / best PID {after / best:.2f} (goal {BEST_PID:.2f})")
            print(f"  after / before   {after / before:.2f} (goal {BEFORE:.2f})")
            reached = reached and after <= BEST_PID * best and after <= BEFORE * before
            curves[size] = {name: response for name, (_, response) in found.items()}
    if options.picture:
        picture(curves[SIZES[0]]).write_html(options.picture, config={"displayModeBar": False})
    return 0 if reached else 1


def picture(curves: dict[str, Response]) -> Any:
    """The errors on the bench itself, over two periods."""
    import plotly.graph_objects as go

    figure = go.Figure()
    colours = {"pid": "#8b93a1", "npid": "#c9a227", "inversion before": "#3a8fd0", "inversion after": "#e0662a"}
    for name, response in curves.items():
        error = 1e3 * (response.reference - response.position)
        figure.add_scatter(x=response.time[::5], y=error[::5], name=name, line={"color": colours[name], "width": 1.6})
    figure.update_layout(
        title="Error of a 0.5 Hz sine of 50 mm on a bench with a dead band and dry friction that its data sheet lacks",
        xaxis_title="time [s]", yaxis_title="error [mm]", template="plotly_white", width=1000, height=420,
    )  # fmt: skip
    return figure


if __name__ == "__main__":
    raise SystemExit(main())
