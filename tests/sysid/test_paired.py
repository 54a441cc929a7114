"""Two runs of one command, each with one pressure, are read as one run with both."""

from __future__ import annotations

import numpy as np
import pytest

from hydraulic_sysid.data.records import Record
from hydraulic_sysid.data.records.paired import APART, paired, partner_of

DT, N = 1e-3, 8000
times = DT * np.arange(N)
DRIVE = np.where(times < 4.0, 2.0, -2.0)


def run(name: str, pressure: str, stop: float = 3.0, drive: np.ndarray = DRIVE, **description: object) -> Record:
    """A stroke that ends at ``stop`` [s] and its way back, seen by a sensor with 0.5 mm of noise."""
    noise = np.random.default_rng(len(name)).normal(0.0, 5e-4, N)
    position = 0.05 * np.minimum(times, stop) - 0.05 * np.clip(times - 4.0, 0.0, stop)
    channels = {"drive": drive, "position": position + noise, f"pressure_{pressure}": 1e6 + 1e5 * times}
    return Record.sampled(name, DT, channels, description=description)


def test_both_pressures_of_two_runs_are_in_one_record() -> None:
    other = run("third", "b")
    (one, alone) = paired([run("first", "a"), run("second one", "a"), other])
    assert (one.name, alone.name) == ("first", "second one")
    assert np.array_equal(one["pressure_b"], other["pressure_b"])
    assert partner_of(one) == "third"
    assert partner_of(alone) is None
    assert not one[APART].any()


def test_where_one_run_stands_while_the_other_moves_they_say_nothing_together() -> None:
    (one,) = paired([run("first", "a", stop=3.0), run("second", "b", stop=2.6)])
    apart = times[one[APART] > 0.0]
    inside = (apart > 2.4) & (apart < 3.2) | (apart > 6.4) & (apart < 7.2)
    assert inside.all()
    for begin, end in ((2.6, 3.0), (6.6, 7.0)):
        assert one[APART][(times > begin + 0.02) & (times < end - 0.02)].all()


@pytest.mark.parametrize(
    "other",
    [
        run("same pressure", "a"),
        run("another command", "b", drive=DRIVE + 0.01 * np.sin(times)),
        run("another load", "b", settings={"moving_mass": 3.0}),
        run("another way", "b", stop=1.0),
    ],
    ids=lambda record: record.name,
)
def test_other_runs_stay_alone(other: Record) -> None:
    first = run("first", "a")
    assert paired([first, other]) == [first, other]


def test_runs_of_no_command_stay_alone() -> None:
    still = np.zeros(N)
    both = [run("first", "a", drive=still), run("second", "b", drive=still)]
    assert paired(both) == both
