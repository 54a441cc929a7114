"""How fast a piston meets its stop, whoever commands: random and hostile streams of commands through the command gate.

    python benchmarks/end_stops.py [--streams 1000] [--laws 300] [--seconds 3] [--seed 2026] [--bench NAME …]
        [--unlimited]

Benches: ``bus``, with the limits of the shipped bus file and the pistons of the bench that it is for, half of them as
built; and every shipped model, with the limits that the simulator takes from it for the same impact speed. Streams are
random, hostile, and those of every law of control with unstable gains; most start near an end. Printed is the
distribution of the speed at contact, per kind of stream; the exit code is 1 where one is beyond the impact speed.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

import hydraulic_bringup.demo
from hydraulic_can_driver.bus_file import load_bus
from hydraulic_control import gains_file
from hydraulic_control.controller import Controller
from hydraulic_control.errors import ControlError
from hydraulic_control.laws import laws
from hydraulic_control.parameters import SPECS
from hydraulic_interfaces.contract import DRIVE_LIMIT_V
from hydraulic_interfaces.samples import Command
from hydraulic_plant_node.command_gate import CommandGate
from hydraulic_plant_node.travel_limits import EndsOfTravel, TravelLimits
from hydraulic_sim.live import LivePlant
from hydraulic_sim.model_file import load_model, presets
from hydraulic_sim.nodes import simulator
from hydraulic_sim.plant import Plant

RATES_HZ = (500.0, 1000.0)
AS_BUILT = Path(hydraulic_bringup.demo.__file__).parent / "models" / "as_built.yaml"
MODELS = ("moog_mcr_m_1002_bench", str(AS_BUILT))
NOISE_M = 2e-5
MS = 1_000_000

Stream = Callable[[float, float, float], float]
"""Drive [V] by time [s], and the position [m] and velocity [m/s] that are seen."""


def constant(rng: np.random.Generator) -> Stream:
    """Full drive into one end."""
    drive = DRIVE_LIMIT_V * rng.choice([-1.0, 1.0])
    return lambda t, x, v: drive


def steps(rng: np.random.Generator) -> Stream:
    """Random levels, held for 2 to 200 ms."""
    levels, hold = rng.uniform(-DRIVE_LIMIT_V, DRIVE_LIMIT_V, 997), rng.uniform(0.002, 0.2)
    return lambda t, x, v: float(levels[int(t / hold) % 997])


def noise(rng: np.random.Generator) -> Stream:
    """White noise, beyond the drive's limit, too."""
    levels = rng.normal(0.0, DRIVE_LIMIT_V, 9973)
    return lambda t, x, v: float(levels[round(t * 1e4) % 9973])


def square(rng: np.random.Generator) -> Stream:
    """A square wave around the resonance of oil and load, with an offset."""
    frequency, amplitude, offset = rng.uniform(20.0, 80.0), rng.uniform(2.0, 10.0), rng.uniform(-5.0, 5.0)
    return lambda t, x, v: offset + amplitude * math.copysign(1.0, math.sin(2.0 * math.pi * frequency * t))


def pulses(rng: np.random.Generator) -> Stream:
    """Pulses to one side around the resonance."""
    frequency, side = rng.uniform(20.0, 80.0), rng.choice([-1.0, 1.0])
    return lambda t, x, v: side * DRIVE_LIMIT_V * (math.sin(2.0 * math.pi * frequency * t) > 0.0)


def run_up(rng: np.random.Generator) -> Stream:
    """Away from an end for a moment, then into it."""
    side, period = rng.choice([-1.0, 1.0]), rng.uniform(0.01, 0.3)
    return lambda t, x, v: side * DRIVE_LIMIT_V * (1.0 if t % period > 0.3 * period else -1.0)


def pump(rng: np.random.Generator) -> Stream:
    """Pump the swing of the load by what is seen of its velocity, a few samples late, and lean to one side."""
    side, late, lean = rng.choice([-1.0, 1.0]), int(rng.integers(0, 12)), rng.uniform(0.0, DRIVE_LIMIT_V)
    seen: list[float] = []

    def drive(t: float, x: float, v: float) -> float:
        seen.append(v)
        swing = seen[max(len(seen) - 1 - late, 0)] - sum(seen[-30:]) / len(seen[-30:])
        return float(side * lean + DRIVE_LIMIT_V * math.copysign(1.0, swing))

    return drive


KINDS = (constant, steps, noise, square, pulses, run_up, pump)
Kind = Callable[[np.random.Generator], Stream]


def unstable(law: str) -> Kind:
    """A controller whose gains are 3 to 100 times what was tuned, on a reference that leaps between the ends."""

    def stream(rng: np.random.Generator) -> Stream:
        controller = wild(law, rng)
        goals, hold = rng.uniform(-1.0, 1.0, 97), rng.uniform(0.05, 1.0)
        last = 0.0

        def drive(t: float, x: float, v: float) -> float:
            nonlocal last
            dt, last = t - last, t
            return controller.step(dt, float(goals[int(t / hold) % 97]), 0.0, x) if dt > 0.0 else 0.0

        return drive

    stream.__name__ = law
    return stream


def wild(law: str, rng: np.random.Generator) -> Controller:
    """The law with gains far beyond its own, as far as its parameters' ranges and its design allow."""
    values = dict(gains_file.load(law))
    for name in laws()[law].tuned:
        spec = SPECS[name]
        low, high = spec.minimum or 0.0, math.inf if spec.maximum is None else spec.maximum
        tried = {**values, name: min(max(values.get(name, spec.default) * 10 ** rng.uniform(0.5, 2.0), low), high)}
        try:
            Controller(tried)
        except ControlError:  # its design refuses it
            continue
        values = tried
    return Controller(values)


LAWS: tuple[Kind, ...] = tuple(unstable(law) for law in laws())


@lru_cache
def plant(model: str, rate: float) -> Plant:
    """The compiled plant of a model file."""
    return Plant.at_rate(load_model(model), rate)


@dataclass(frozen=True)
class Bench:
    """Limits, and the pistons that they are tried on."""

    ends: EndsOfTravel
    models: tuple[str, ...]


def ends_of_the_shipped_bench() -> EndsOfTravel:
    """What the shipped bus file says."""
    ends = load_bus("bench").limits.braking
    assert ends is not None
    return ends


def simulated(model: str, impact_speed: float) -> EndsOfTravel:
    """What the simulator takes from a model file."""
    plant = simulator.Simulator()
    defaults = {spec.name: spec.default for spec in plant.parameters()}
    plant.configure({**defaults, "model": model, "rate": RATES_HZ[0], "impact_speed": impact_speed})
    ends = plant.ends_of_travel()
    assert ends is not None
    return ends


def benches() -> dict[str, Bench]:
    """All that are shipped."""
    bus = ends_of_the_shipped_bench()
    return {"bus": Bench(bus, MODELS), **{m: Bench(simulated(m, bus.impact_speed), (m,)) for m in presets()}}


def impact(
    seed: int, bench: Bench, limited: bool = True, seconds: float = 3.0, kinds: Sequence[Kind] = KINDS
) -> tuple[str, float]:
    """Kind of the stream, and the greatest speed [m/s] towards a stop in contact with it; 0 where it was not met."""
    rng, ends = np.random.default_rng(seed), bench.ends
    kind, rate = kinds[rng.integers(len(kinds))], float(rng.choice(RATES_HZ))
    body = plant(str(rng.choice(bench.models)), rate)
    near = rng.choice([-1.0, 1.0]) * (ends.high - 0.04 * rng.random() ** 2)
    start = float(near if rng.random() < 0.7 else rng.uniform(ends.low, ends.high))
    live = LivePlant(body, body.initial_state(position=start))
    stream, gate = kind(rng), CommandGate()
    gate.limits = TravelLimits(ends, 1.0 / rate) if limited else None
    gate.enable(True)
    position, velocity, greatest = start, 0.0, 0.0
    for i in range(round(seconds * rate)):
        now = round(i * 1e9 / rate)
        gate.accept(Command(now, "stranger", stream(i / rate, position, velocity)), now)
        sample = live.step(gate.drive(now), 1.0 / rate)
        position = sample.position + NOISE_M * rng.standard_normal()
        gate.observe(position)
        velocity = sample.velocity
        outwards = velocity * math.copysign(1.0, sample.position)
        # Seen at the instant before contact, too: within it the stop brakes already.
        if outwards > 0.0 and ends.high - abs(sample.position) <= 1.2 * outwards / rate:
            greatest = max(greatest, outwards)
    return kind.__name__, greatest


def cost(ends: EndsOfTravel, count: int = 200_000) -> float:
    """Time [s] of the limits per sample."""
    limits = TravelLimits(ends, 1e-3)
    begun = time.perf_counter()
    for i in range(count):
        limits.observe(0.7 + 1e-7 * i)
        limits.limited(5.0)
    return (time.perf_counter() - begun) / count


def tell(bench: Bench, options: argparse.Namespace) -> float:
    """Print the distribution; the greatest speed at a contact."""
    found: dict[str, list[float]] = {kind.__name__: [] for kind in (*KINDS, *LAWS)}
    for kinds, count in ((KINDS, options.streams), (LAWS, options.laws)):
        for seed in range(options.seed, options.seed + count):
            kind, speed = impact(seed, bench, not options.unlimited, options.seconds, kinds)
            found[kind].append(speed)
    print(f"{'stream':22} {'runs':>5} {'contact':>8} {'p50 mm/s':>9} {'p99 mm/s':>9} {'max mm/s':>9}")
    everything = [speed for speeds in found.values() for speed in speeds]
    for name, speeds in {**found, "all": everything}.items():
        met = 1e3 * np.array([speed for speed in speeds if speed > 0.0] or [0.0])
        contacts = sum(speed > 0.0 for speed in speeds)
        p50, p99 = np.quantile(met, [0.5, 0.99])
        print(f"{name:22} {len(speeds):5} {contacts:8} {p50:9.1f} {p99:9.1f} {met.max():9.1f}")
    return max(everything)


def main() -> int:
    """Print the distributions; 1 where a piston met its stop too fast."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    shipped = benches()
    parser.add_argument("--streams", type=int, default=1000, help="on each bench")
    parser.add_argument("--laws", metavar="N", type=int, default=300, help="streams of unstable controllers")
    parser.add_argument("--seconds", type=float, default=3.0)
    parser.add_argument("--seed", type=int, default=2026)
    parser.add_argument("--bench", nargs="+", choices=list(shipped), default=list(shipped))
    parser.add_argument("--unlimited", action="store_true", help="without the limits, for comparison")
    options = parser.parse_args()
    late = []
    for name in options.bench:
        bench = shipped[name]
        print(f"== {name}: allowed are {1e3 * bench.ends.impact_speed:g} mm/s", flush=True)
        if tell(bench, options) > bench.ends.impact_speed:
            late.append(name)
    print(f"the limits take {1e6 * cost(shipped['bus'].ends):.2f} us per sample")
    print("faster than allowed: " + (", ".join(late) or "none"))
    return int(bool(late))


if __name__ == "__main__":
    sys.exit(main())
