"""The same excitation of the same plant, through the simulator and through driver and virtual devices."""

from __future__ import annotations

from dataclasses import replace
from importlib import resources
from pathlib import Path

import can
import numpy as np
import pytest

from hydraulic_bringup.model_plant import ModelPlant
from hydraulic_can_driver.bench import Bench
from hydraulic_can_driver.bus_file import load_bus
from hydraulic_can_driver.cia408 import State
from hydraulic_can_driver.virtual import VirtualBench
from hydraulic_interfaces.samples import PlantSample
from hydraulic_sim.model_file import load_model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.estimation.metrics import best_fit
from hydraulic_sysid.excitation.signals.random_phase_multisine import RandomPhaseMultisine
from hydraulic_sysid.linear.identification import IdentificationSettings, identify

RATE, SECONDS = 500.0, 16.0
MODEL = load_model(Path(str(resources.files("hydraulic_bringup.demo") / "models" / "as_built.yaml")))


def excitation() -> np.ndarray:
    t = np.arange(round(SECONDS * RATE)) / RATE
    signal = RandomPhaseMultisine(rms=1.0, period=8.0, frequency_min=0.25, frequency_max=20.0, seed=3)
    return signal.sample(t)


def over_can(drive: np.ndarray) -> list[PlantSample]:
    """In lockstep: on a busy machine slower than in real time, which must not matter."""
    bus = replace(load_bus("bench"), rate=RATE)
    line = can.Bus(interface="virtual", channel="agreement")
    samples: list[PlantSample] = []
    with VirtualBench(bus, line, ModelPlant(MODEL, RATE), lockstep=True) as devices:
        bench = Bench(bus, "virtual", "agreement", lockstep=True)

        def step(u: float) -> None:
            sample = bench.cycle(bench.beat.next_sync(), u)
            assert sample is not None and not bench.problem, f"{bench.problem} after {len(samples)} samples"
            samples.append(sample)

        try:
            bench.boot()
            bench.start()
            bench.follow(State.ACTIVE)
            while not bench.machine.active:
                step(0.0)
            samples.clear()
            for u in drive:
                step(float(u))
        finally:
            bench.close()
    line.shutdown()
    assert devices.error is None
    return samples


def record(name: str, drive: np.ndarray, position: np.ndarray) -> Record:
    time = np.arange(drive.size) / RATE
    return Record(name, time, 1.0 / RATE, {"drive": drive, "position": position})


@pytest.fixture(name="records", scope="module")
def records_fixture() -> tuple[Record, Record]:
    """Of the simulator, and over CAN."""
    drive = excitation()
    simulated = Plant(MODEL).simulate(drive, 1.0 / RATE)
    measured = over_can(drive)
    return (
        record("sim", simulated.drive, simulated.position),
        record("can", np.array([s.drive for s in measured]), np.array([s.position for s in measured])),
    )


def test_drive_and_position_differ_by_counts(records: tuple[Record, Record]) -> None:
    sim, over = records
    count = 10.0 / 16384
    assert np.abs(over["drive"] - sim["drive"]).max() <= 0.5 * count + 1e-12
    # What is rounded off the drive is integrated: less than a hundredth of a millimetre per second of record.
    assert np.abs(over["position"] - sim["position"]).max() < 1e-5 * SECONDS
    assert best_fit(sim["position"], over["position"]) > 99.5


def test_identified_models_agree(records: tuple[Record, Record]) -> None:
    sim, over = records
    settings = IdentificationSettings(sampling_time=0.01)
    _, model_sim = identify([sim], None, settings)
    _, model_can = identify([over], None, settings)
    step = round(settings.sampling_time * RATE)
    drive = sim["drive"][: sim["drive"].size // step * step].reshape(-1, step).mean(axis=1)
    start = sim["position"][::step][: drive.size]
    by_sim, by_can = model_sim.simulate(drive, start), model_can.simulate(drive, start)
    assert best_fit(by_sim, by_can) >= 99.0
    assert best_fit(by_can, by_sim) >= 99.0
