"""The same excitation of the same plant, once through the simulator and once through the bus: the same model comes out.

In lockstep, so that no sample is lost on a busy machine: everything else (frames, coding,
quantisation, state machines, the SYNC that takes the drive over) is as on a bench.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from hydraulic_bringup.model_plant import ModelPlant
from hydraulic_can_driver.bench import Bench
from hydraulic_can_driver.bus import Bus
from hydraulic_can_driver.can_bus import open_can
from hydraulic_can_driver.cia408 import State
from hydraulic_can_driver.virtual import VirtualBench
from hydraulic_interfaces.samples import PlantSample
from hydraulic_sim.model_file import load_model
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.data.resampling import held_average
from hydraulic_sysid.estimation.metrics import best_fit
from hydraulic_sysid.excitation import load_plan
from hydraulic_sysid.linear.identification import IdentificationSettings, identify
from hydraulic_sysid.linear.models import Arx, ArxOrder

RATE, SECONDS = 500.0, 12.0
MODEL = "moog_mcr_m_1002_bench"
NOISE = {"position_noise": 20e-6, "pressure_noise": 15e3}  # of the demo's sensors
DT = 0.02  # sampling time of the identified models, s


def record(name: str, step: Callable[[int, float], PlantSample]) -> Record:
    """A multisine with the centring of its plan, played sample by sample."""
    plan = replace(load_plan("multisine"), rate=RATE)
    signal = plan.open_loop[: round(SECONDS * RATE)]
    samples: list[PlantSample] = []
    position = 0.0
    for number, drive in enumerate(signal):
        centring = min(max(-plan.centring_gain * position, -plan.centring_limit), plan.centring_limit)
        samples.append(step(number, float(drive) + centring))
        position = samples[-1].position
    channels = {key: np.array([getattr(s, key) for s in samples]) for key in ("drive", "position", "pressure_a")}
    return Record.sampled(name, 1.0 / RATE, channels)


@pytest.fixture(scope="module")
def simulated() -> Record:
    from hydraulic_sim.nodes.simulator import Simulator

    plant = Simulator()
    values = {spec.name: spec.default for spec in plant.parameters()}
    plant.configure({**values, **NOISE, "model": MODEL, "rate": RATE, "noise_seed": 1})
    plant.activate()
    return record("simulator", lambda number, drive: plant.step(number, drive, 1.0 / RATE))


@pytest.fixture
def over_can(patient: Bus) -> Iterator[Record]:
    bus = replace(patient, rate=RATE, channel="same records")
    line = open_can(bus.interface, bus.channel)
    devices = VirtualBench(bus, line, ModelPlant(load_model(MODEL), RATE, seed=2, **NOISE), lockstep=True)
    devices.start()
    bench = Bench(bus, lockstep=True)
    bench.boot()
    bench.start()
    bench.machine.ask(State.ACTIVE, bench.now())

    def step(number: int, drive: float) -> PlantSample:
        sample = bench.cycle(bench.beat.next_sync(), drive)
        assert sample is not None and not bench.problem, bench.problem
        return sample

    while not bench.machine.active:
        step(0, 0.0)
    yield record("can", step)
    bench.close()
    devices.stop()
    line.shutdown()


def test_the_same_model_comes_out(simulated: Record, over_can: Record) -> None:
    settings = IdentificationSettings(structure=Arx(ArxOrder(3, 3, 1)), sampling_time=DT)
    models: dict[str, Any] = {r.name: identify([r], settings=settings)[1] for r in (simulated, over_can)}
    for data in (simulated, over_can):
        u = held_average(data["drive"], data.dt, DT)
        runs = {name: model.simulate(u, np.zeros(u.size)) for name, model in models.items()}
        fit = best_fit(runs["simulator"], runs["can"])
        print(f"on the record of {data.name}: {fit:.3f} %")
        assert fit >= 99.0
    # and what was recorded is what the other model says, within what either model leaves open
    drive = over_can["drive"]
    assert np.abs(drive / (10.0 / 16384) - np.round(drive / (10.0 / 16384))).max() < 1e-6, "quantised as on the bus"
    assert best_fit(simulated["position"], over_can["position"]) > 99.0
