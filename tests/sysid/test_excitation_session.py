"""Sessions: what a start waits for, what a run tells, and how it ends, without ROS."""

from __future__ import annotations

import json
import math
from typing import Any

import pytest

from hydraulic_interfaces.samples import PlantSample
from hydraulic_sysid.excitation import Phase, Plan, Session
from hydraulic_sysid.excitation.signals.steps import Steps

PLANT_ROW, COMMAND_ROW = "/actuator/plant: plant", "/actuator/plant: command"
START_NS = 1_700_000_000_000_000_000
PLAN = Plan("any", Steps([2.0], 1.0), 0.3, fade_in=0.0, fade_out=0.0, rest_before=0.1, rest_after=0.1)


class Bench:
    """A plant that integrates what it is told, at 1 kHz, and a session that drives it."""

    def __init__(self, **report: str) -> None:
        self.events: list[dict[str, Any]] = []
        self.listeners = 1
        self.session = Session(lambda event: self.events.append(json.loads(event)), lambda: self.listeners)
        self.session.arm(PLAN)
        self.step_count, self.position, self.drive = 0, 0.0, 0.0
        self.apply = lambda drive: drive
        self.commands: list[float | None] = []
        if report.pop("silent", "") == "":
            self.says(**report)

    def says(self, enabled: str = "True", source: str = "", message: str = "active, enabled") -> None:
        ok = not message.startswith("stopped")
        self.session.diagnose(PLANT_ROW, ok, message, {"enabled": enabled})
        self.session.diagnose(COMMAND_ROW, True, "", {"source": source})
        self.session.diagnose("/left/plant: plant", False, "of no interest", {"enabled": "False"})

    @property
    def now(self) -> float:
        return self.step_count * 0.001

    def run(self, steps: int) -> Bench:
        for _ in range(steps):
            stamp = START_NS + self.step_count * 1_000_000
            sample = PlantSample(stamp, position=self.position, drive=self.drive)
            command = self.session.answer(sample, self.now)
            self.commands.append(command)
            self.drive = self.apply(command or 0.0)
            self.position += 0.03 * self.drive * 0.001
            self.step_count += 1
        return self

    @property
    def kinds(self) -> list[str]:
        return [event["event"] for event in self.events]


def test_a_run_from_start_to_finish():
    bench = Bench().run(1201)
    assert bench.kinds == ["started", "finished"]
    # 2 V move this plant by 0.06 m, for which centring takes back 0.12 V
    assert bench.commands[99:101] == [0.0, 2.0] and bench.commands[1099:1101] == [
        pytest.approx(1.89, abs=0.02),
        0.0,
    ]
    assert bench.commands[-1] == 0.0
    started, finished = bench.events
    assert started["stamp_ns"] == started["started_ns"] == finished["started_ns"] == START_NS
    assert finished["stamp_ns"] == START_NS + 1_200_000_000
    assert finished["played"] == finished["samples"] == 1200 and finished["reason"] == ""
    assert Plan.from_mapping(finished["plan"]) == PLAN
    assert bench.session.ended is Phase.FINISHED and not bench.session.busy
    assert bench.run(10).commands[-10:] == [None] * 10, "after the end nothing is commanded"


@pytest.mark.parametrize(
    ("report", "listeners", "words"),
    [
        ({"silent": "yes"}, 1, "it says: no diagnostics of the plant yet"),
        ({"enabled": "False", "message": "active, not enabled"}, 1, "it says: active, not enabled"),
        ({"enabled": "False", "message": "stopped until reset: x"}, 1, "it says: stopped until reset: x"),
        ({"source": "controller"}, 1, "'controller' to stop commanding"),
        ({}, 0, "2 listeners to commands (there are 0)"),
        ({}, 1, "2 listeners to commands (there are 1)"),
    ],
)
def test_an_obstacle_holds_the_start_and_has_words(report, listeners, words):
    bench = Bench(**report)
    if "listeners" in words:
        bench.session.listeners_needed = 2
    bench.listeners = listeners
    bench.run(300)
    assert words in bench.session.obstacle(bench.now)
    assert bench.events == [] and bench.commands == [None] * 300
    bench.listeners = 2
    bench.says()
    assert bench.session.obstacle(bench.now) == ""
    assert bench.run(1).kinds == ["started"]


def test_without_states_nothing_starts():
    bench = Bench()
    assert bench.session.obstacle(0.0) == "the state of the plant"
    bench.session.armed = None
    bench.run(10)
    assert bench.session.obstacle(bench.now) == ""
    assert bench.session.obstacle(bench.now + 0.6) == "the state of the plant"


def test_a_plant_that_is_disabled_ends_the_run_with_its_own_words():
    bench = Bench().run(500)
    assert bench.commands[-1] > 1.0
    bench.says(enabled="False", message="stopped until reset: emergency stop")
    bench.run(200)
    assert bench.kinds == ["started", "aborted"]
    reason = bench.events[-1]["reason"]
    assert reason == ("the plant is not enabled any more; the plant says: stopped until reset: emergency stop")
    assert bench.events[-1]["played"] == 500 < bench.events[-1]["samples"]
    assert bench.commands[500] == 0.0 and bench.commands[-1] is None
    assert bench.session.ended_badly and reason in bench.session.last_end


def test_a_plant_that_applies_something_else_ends_the_run():
    bench = Bench().run(500)
    bench.apply = lambda drive: 0.0
    bench.run(600)
    assert bench.kinds == ["started", "aborted"]
    assert "the plant applied 0.000" in bench.events[-1]["reason"]


def test_the_reason_holds_what_the_plant_complained_of_during_the_run():
    bench = Bench()
    bench.session.diagnose(COMMAND_ROW, False, "no command: drive is 0 V", {"source": ""})
    bench.run(500)
    bench.session.diagnose(COMMAND_ROW, False, "watchdog: no command for 0.05 s", {"source": "excitation"})
    bench.session.diagnose(COMMAND_ROW, True, "obeys 'excitation'", {"source": "excitation"})
    bench.position = math.nan
    bench.run(1)
    expected = "the position is nan; the plant says: watchdog: no command for 0.05 s"
    assert bench.events[-1]["reason"] == expected


def test_an_abort_on_request_does_not_blame_the_plant():
    bench = Bench().run(500)
    bench.session.diagnose(COMMAND_ROW, False, "no command: drive is 0 V", {"source": ""})  # said before the run
    assert bench.session.stop("asked to abort")
    bench.run(1500)
    assert bench.events[-1]["reason"] == "asked to abort"


def test_a_piston_that_runs_away_ends_the_run():
    bench = Bench().run(500)
    bench.position = 0.31
    assert bench.run(1).commands[-1] == 0.0
    assert "the piston is at 310.0 mm" in bench.events[-1]["reason"]


def test_a_position_that_is_no_number_ends_the_run():
    bench = Bench().run(500)
    bench.position = math.nan
    assert bench.run(1).commands[-1] == 0.0
    assert "the position is nan" in bench.events[-1]["reason"]


def test_silence_ends_the_run_with_a_last_zero():
    bench = Bench().run(500)
    last = bench.now - 0.001
    assert bench.session.silence(last + 0.49) is None
    stamp, drive = bench.session.silence(last + 0.75)
    assert drive == 0.0 and stamp == START_NS + 499_000_000 + 750_000_000
    assert bench.kinds == ["started", "aborted"]
    assert "no state for 0.750 s (allowed: 0.5 s)" in bench.events[-1]["reason"]
    assert not bench.session.busy and bench.session.silence(last + 2.0) is None


def test_a_stop_ramps_down_before_it_is_announced():
    bench = Bench().run(500)
    assert bench.session.stop("asked to")
    bench.run(50)
    assert bench.kinds == ["started"] and 0.0 < bench.commands[-1] < bench.commands[499]
    bench.run(200)
    assert bench.kinds == ["started", "aborted"] and bench.events[-1]["reason"] == "asked to"
    assert not bench.session.stop("again")


def test_a_start_that_waits_can_be_called_off():
    bench = Bench(enabled="False").run(10)
    assert bench.session.stop("") and not bench.session.busy
    bench.says()
    assert bench.run(10).events == []


def test_runs_follow_each_other():
    bench = Bench().run(1250)
    bench.session.arm(PLAN)
    bench.run(1250)
    assert bench.kinds == ["started", "finished"] * 2
    assert bench.events[2]["started_ns"] == START_NS + 1_250_000_000
