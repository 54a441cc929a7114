"""No publisher drives a piston into its stop: a small seeded part of `benchmarks/end_stops.py`."""

from __future__ import annotations

import pytest

from end_stops import KINDS, LAWS, MODELS, Kind, benches, ends_of_the_shipped_bench, impact, plant
from hydraulic_can_driver.bus_file import load_bus
from hydraulic_plant_node.travel_limits import TravelLimits
from hydraulic_sim.live import LivePlant


def test_no_stream_of_commands_drives_the_piston_into_its_stop() -> None:
    bench = benches()["bus"]
    found = [impact(seed, bench, seconds=1.0) for seed in range(60)]
    assert {kind for kind, _ in found} == {kind.__name__ for kind in KINDS}
    assert sum(speed > 0.0 for _, speed in found) > 5, "some do meet it"
    assert max(speed for _, speed in found) <= bench.ends.impact_speed == pytest.approx(0.05)


def test_a_bench_that_hardly_damps_the_swing_of_its_load_is_held_as_well() -> None:
    """Streams that met the stop at up to 145 mm/s while a drive could reverse at once before the ends."""
    bench = benches()["sample_bench"]
    speeds = [impact(seed, bench)[1] for seed in (2050, 2056, 2085, 2089, 2103, 2136, 2175)]
    assert max(speeds) <= bench.ends.impact_speed == pytest.approx(0.05)


@pytest.mark.parametrize("law", LAWS, ids=lambda kind: kind.__name__)
def test_an_unstable_controller_meets_the_gate_not_the_stop(law: Kind) -> None:
    bench = benches()["bus"]
    speeds = [impact(seed, bench, seconds=1.0, kinds=(law,))[1] for seed in range(2)]
    assert max(speeds) <= bench.ends.impact_speed == pytest.approx(0.05)


def test_without_the_gate_unstable_controllers_meet_the_stop() -> None:
    bench = benches()["bus"]
    speeds = [impact(seed, bench, limited=False, seconds=1.0, kinds=LAWS)[1] for seed in range(20)]
    assert sum(speed > 0.3 for speed in speeds) > 2


def test_without_the_limits_the_same_streams_do() -> None:
    bench = benches()["bus"]
    speeds = [impact(seed, bench, limited=False, seconds=1.0)[1] for seed in range(10)]
    assert max(speeds) > 0.3


@pytest.mark.parametrize("distance", [0.1, 0.05, 0.02, 0.005])
def test_a_driver_that_dies_before_the_stop_has_left_room_enough(distance: float) -> None:
    """At full drive outwards: the valve goes on for `lost_after`, then it closes."""
    ends, rate, lost_after = ends_of_the_shipped_bench(), 500.0, load_bus("bench").master.lost_after
    body = plant(MODELS[0], rate)
    live, limits = LivePlant(body, body.initial_state(position=0.5)), TravelLimits(ends, 1.0 / rate)
    limits.observe(0.5)
    drive, died, fastest = 0.0, None, 0.0
    for i in range(round(2.5 * rate)):
        if died is None:
            drive = limits.limited(10.0)
        elif i / rate - died > lost_after:
            drive = 0.0
        sample = live.step(drive, 1.0 / rate)
        limits.observe(sample.position)
        if died is None and ends.high - sample.position < distance:
            died = i / rate
        if ends.high - sample.position < 1e-3:
            fastest = max(fastest, sample.velocity)
    assert died is not None
    assert fastest <= ends.impact_speed
