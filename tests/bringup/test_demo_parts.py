"""The parts of the demo without a graph: children, repeated experiments, bags with gaps, options."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hydraulic_bringup.demo import offline, online, processes
from hydraulic_bringup.demo.errors import DemoError
from hydraulic_bringup.verbs import demo
from hydraulic_sysid.data.records import Record, to_bag

SAMPLE = Path(__file__).parents[2] / "examples" / "sample_bench"


class Said:
    """Steps that only listen."""

    def __init__(self) -> None:
        self.texts: list[str] = []

    def begin(self, text: str, seconds: float) -> None:
        pass

    def tick(self) -> None:
        pass

    def done(self) -> None:
        pass

    def say(self, text: str) -> None:
        self.texts.append(text)


@pytest.fixture
def modules(tmp_path: Path) -> Callable[[str, str], dict[str, str]]:
    """`modules(name, text)` writes a module and gives an environment in which `python -m name` finds it."""

    def write(name: str, text: str) -> dict[str, str]:
        (tmp_path / f"{name}.py").write_text(text)
        return {**os.environ, "PYTHONPATH": str(tmp_path)}

    return write


def test_a_child_that_ends_early_is_named_with_its_last_words(tmp_path: Path, modules: Any) -> None:
    env = modules("brief", "import sys\nprint('the valve is gone')\nsys.exit(3)\n")
    with processes.Crew(tmp_path / "logs", env) as crew:
        crew.start("plant", "brief")
        with pytest.raises(DemoError) as caught:
            crew.wait(lambda: False, "excite", 20.0)
    assert caught.value.step == "excite"
    assert "plant" in caught.value.why
    assert "exit code 3" in caught.value.why
    assert "the valve is gone" in caught.value.why
    assert caught.value.remedy == f"log: {tmp_path / 'logs' / 'plant.log'}"


def test_only_the_exit_codes_that_are_in_order_are_taken(tmp_path: Path, modules: Any) -> None:
    env = modules("brief", "raise SystemExit(1)\n")
    with processes.Crew(tmp_path / "logs", env) as crew:
        child = crew.start("excitation", "brief")
        child.may_end = (0, 1)
        crew.wait(lambda: child.exit_code is not None, "excite", 20.0)
        crew.check("excite")
        child.may_end = (0,)
        with pytest.raises(DemoError, match="exit code 1"):
            crew.check("excite")


def test_waiting_ends_and_shows_what_the_others_said(tmp_path: Path, modules: Any) -> None:
    env = modules("idle", "import time\nprint('still thinking', flush=True)\ntime.sleep(60)\n")
    with processes.Crew(tmp_path / "logs", env) as crew:
        child = crew.start("recorder", "idle")
        crew.wait(lambda: "thinking" in child.tail(), "start", 20.0)
        with pytest.raises(DemoError, match=r"(?s)'start the recorder': waited 0.1 s in vain.*still thinking"):
            crew.wait(lambda: False, "start the recorder", 0.1)
    assert not child.alive()


STUBBORN = """
import signal, subprocess, sys, time
for number in (signal.SIGINT, signal.SIGTERM):
    signal.signal(number, signal.SIG_IGN)
if len(sys.argv) == 1:
    subprocess.Popen([sys.executable, "-m", "stubborn", "child"])
    print("ready", flush=True)
time.sleep(60)
"""


def test_whoever_ignores_signals_is_killed_with_its_children(
    tmp_path: Path, modules: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(processes, "_ESCALATION", ((signal.SIGINT, 0.1), (signal.SIGTERM, 0.1), (signal.SIGKILL, 10.0)))
    with processes.Crew(tmp_path / "logs", modules("stubborn", STUBBORN)) as crew:
        child = crew.start("stubborn", "stubborn")
        crew.wait(lambda: "ready" in child.tail(), "start", 20.0)
        assert child.alive()
    assert not child.alive()
    assert child.ending() == "it was killed by SIGKILL"


def test_a_second_interrupt_waits_until_all_children_are_ended(tmp_path: Path, modules: Any) -> None:
    before = signal.getsignal(signal.SIGINT)
    env = modules("idle", "import time\nprint('up', flush=True)\ntime.sleep(60)\n")

    class Interrupting(processes.Child):
        def stop(self) -> None:
            os.kill(os.getpid(), signal.SIGINT)
            super().stop()

    with pytest.raises(KeyboardInterrupt), processes.Crew(tmp_path / "logs", env) as crew:
        child = crew.start("idle", "idle")
        crew.wait(lambda: "up" in child.tail(), "start", 20.0)
        child.__class__ = Interrupting
        raise KeyboardInterrupt
    assert not child.alive()
    assert signal.getsignal(signal.SIGINT) is before


@pytest.fixture
def runs(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[[list[str]], Iterator[Path]]:
    """Outcomes of successive runs: empty, or why one was aborted; each leaves a bag."""

    def play(reasons: list[str]) -> list[Path]:
        folders: list[Path] = []

        def one(crew: Any, client: Any, experiment: Any, bag: Path, steps: Any, attempt: int) -> str:
            bag.mkdir()
            folders.append(bag)
            assert attempt == len(folders)
            return reasons[attempt - 1]

        monkeypatch.setattr(online, "excite_and_record", one)
        return folders

    return play  # type: ignore[return-value]


class Plant:
    """What a client asks of the plant; `fault` is the answer to reset, `refusal` that to enable."""

    def __init__(self, refusal: str = "", fault: str = "") -> None:
        self.asked: list[str] = []
        self._refusal, self._fault = refusal, fault

    def reset(self, patience: float) -> str:
        self.asked.append("reset")
        return "" if "configure" in self.asked else self._fault

    def change_state(self, label: str, patience: float, meanwhile: Any) -> bool:
        self.asked.append(label)
        return True

    def enable(self, patience: float) -> str:
        self.asked.append("enable")
        return self._refusal


def test_an_aborted_experiment_is_run_again_and_its_bag_kept_aside(runs: Any, tmp_path: Path) -> None:
    runs(["no state for 0.6 s", ""])
    said, plant = Said(), Plant()
    bag = online.record_experiment(None, plant, online.Experiment("chirp", Path("p.yaml")), tmp_path, said, 2)  # type: ignore[arg-type]
    assert bag == tmp_path / "chirp"
    assert bag.is_dir()
    assert (tmp_path / "chirp.aborted").is_dir()
    assert plant.asked == ["reset", "enable"], "what aborted it may be a fault that is latched"
    assert len(said.texts) == 1
    assert "no state for 0.6 s" in said.texts[0]


@pytest.mark.parametrize("attempts", [1, 2])
def test_the_last_attempt_that_is_aborted_fails_the_step(runs: Any, tmp_path: Path, attempts: int) -> None:
    folders = runs(["travel", "travel"])
    with pytest.raises(DemoError, match="'chirp: excite and record': aborted: travel"):
        online.record_experiment(None, Plant(), online.Experiment("chirp", Path("p")), tmp_path, Said(), attempts)  # type: ignore[arg-type]
    assert len(folders) == attempts


def test_a_fault_that_stays_takes_the_plant_through_its_whole_life(runs: Any, tmp_path: Path) -> None:
    runs(["not started: waited", ""])
    plant = Plant(fault="configure it anew")
    online.record_experiment(None, plant, online.Experiment("chirp", Path("p.yaml")), tmp_path, Said(), 2)  # type: ignore[arg-type]
    assert plant.asked == ["reset", "deactivate", "cleanup", "configure", "activate", "reset", "enable"]


def test_a_plant_that_stays_at_fault_fails_the_step(runs: Any, tmp_path: Path) -> None:
    runs(["valve fault", ""])
    with pytest.raises(DemoError, match="'chirp: run it once more': the plant was not enabled again: pressure lost"):
        online.record_experiment(
            None,  # type: ignore[arg-type]
            Plant("pressure lost"),
            online.Experiment("chirp", Path("p.yaml")),
            tmp_path,
            Said(),
            2,
        )


@pytest.mark.parametrize("lockstep", [True, False])
def test_over_can_the_demo_brings_its_own_devices_and_touches_no_real_bus(lockstep: bool) -> None:
    """A real actuator is not for a demo, least of all for its second attempt."""

    class Started:
        def start(self, name: str, module: str, *arguments: str) -> None:
            self.module, self.arguments = module, arguments

        def wait(self, *_: Any) -> None:
            pass

    crew = Started()
    values = online.start_devices(crew, Path("m.yaml"), Said(), lockstep)  # type: ignore[arg-type]
    assert values["interface"] == "udp_multicast"
    assert crew.module == "hydraulic_bringup.verbs.virtual_bench"
    options = [option for option in crew.arguments if option != "--lockstep"]
    assert (len(options) < len(crew.arguments)) == lockstep
    told = dict(zip(options[::2], options[1::2], strict=True))
    assert told["--interface"] == values["interface"]
    assert told["--channel"] == values["channel"]
    assert told["--bus"] == values["bus"]


def bag_without(folder: Path, lost: list[int], samples: int = 2000) -> Path:
    """A bag at 1 kHz in which some samples are missing."""
    time = 1e-3 * np.arange(samples)
    channels = {"drive": np.sin(time), "position": 1e-3 * time}
    record = Record.sampled(folder.name, 1e-3, channels, folder, {})
    keep = np.setdiff1d(np.arange(samples), lost)
    holey = replace(record)
    object.__setattr__(holey, "time", time[keep])
    object.__setattr__(holey, "channels", {name: values[keep] for name, values in channels.items()})
    return to_bag(holey, folder)


def test_a_whole_bag_is_read_without_a_word(tmp_path: Path) -> None:
    said = Said()
    (record,) = offline.read_bag(bag_without(tmp_path / "chirp", []), said, 0.0)
    assert len(record) == 2000
    assert said.texts == []


def test_a_few_missing_samples_are_interpolated_and_told(tmp_path: Path) -> None:
    said = Said()
    (record,) = offline.read_bag(bag_without(tmp_path / "chirp", [500, 501, 900]), said, 0.01)
    assert len(record) == 2000
    assert record["position"] == pytest.approx(1e-6 * np.arange(2000), abs=1e-12)
    assert said.texts == ["3 of 2000 samples of chirp are missing: interpolated"]


def test_many_missing_samples_fail_the_step(tmp_path: Path) -> None:
    bag = bag_without(tmp_path / "chirp", list(range(500, 600)))
    with pytest.raises(DemoError, match="'read the bag': 100 of 2000 samples of chirp are missing"):
        offline.read_bag(bag, Said(), 0.01)


def test_in_lockstep_no_sample_may_be_missing(tmp_path: Path) -> None:
    with pytest.raises(DemoError, match="'read the bag': 1 of 2000 samples of chirp are missing"):
        offline.read_bag(bag_without(tmp_path / "chirp", [900]), Said(), 0.0)


def test_a_bag_that_is_none_fails_the_step(tmp_path: Path) -> None:
    (tmp_path / "chirp").mkdir()
    (tmp_path / "chirp" / "chirp_0.mcap").write_bytes(b"\x89MCAP0\r\n")
    with pytest.raises(DemoError, match="read the bag"):
        offline.read_bag(tmp_path / "chirp", Said(), 0.0)


@pytest.fixture
def own_signals() -> Iterator[None]:
    """Puts back what the demo does about SIGTERM."""
    before = signal.getsignal(signal.SIGTERM)
    yield
    signal.signal(signal.SIGTERM, before)


@pytest.mark.parametrize(
    ("arguments", "what"),
    [
        (["--model", "nowhere.yaml"], "nowhere.yaml"),
        (["--record", "nowhere.csv"], "nowhere.csv"),
        (["--record", str(SAMPLE), "--columns", "nowhere"], "nowhere"),
        (["--record", str(SAMPLE), "--model", "sample_bench", "--out", str(SAMPLE)], "not empty"),
    ],
)
@pytest.mark.usefixtures("own_signals")
def test_bad_input_is_one_line_and_exit_code_2(
    arguments: list[str], what: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert demo.main(arguments) == 2
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 1
    assert said[0].startswith("demo: ")
    assert what in said[0]
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("arguments", "what"),
    [
        (["--columns", "split"], "--columns"),
        (["--record", str(SAMPLE), "--quick"], "--quick"),
        (["--record", str(SAMPLE), "--plant", "sim"], "--plant"),
        (["--record", str(SAMPLE), "--no-lockstep"], "--lockstep"),
        (["--plant", "rocket"], "rocket"),
    ],
)
def test_options_that_do_not_fit_are_refused(
    arguments: list[str], what: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert demo.main(arguments) == 2
    assert what in capsys.readouterr().err


@pytest.mark.usefixtures("own_signals")
def test_a_plant_that_is_not_there_is_a_failed_step(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(online.PLANTS, "can", "hydraulic_absent.nodes.can_driver")
    assert demo.main(["--plant", "can", "--out", str(tmp_path / "run")]) == 1
    assert "hydraulic_absent.nodes.can_driver" in capsys.readouterr().err


def test_runs_get_folders_of_their_own_and_latest_shows_the_last(tmp_path: Path) -> None:
    (tmp_path / "latest").symlink_to("gone")
    folder = online.timestamped_folder(tmp_path, "demo")
    assert folder.is_dir()
    assert (tmp_path / "latest").resolve() == folder.resolve()


def test_the_private_domain_is_left_as_it_was_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", "77")
    monkeypatch.delenv("ROS_AUTOMATIC_DISCOVERY_RANGE", raising=False)
    with online.private_domain() as env:
        assert env["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "LOCALHOST"
        assert os.environ["ROS_DOMAIN_ID"] == env["ROS_DOMAIN_ID"]
        assert 0 < int(env["ROS_DOMAIN_ID"]) <= 101
    assert os.environ["ROS_DOMAIN_ID"] == "77"
    assert "ROS_AUTOMATIC_DISCOVERY_RANGE" not in os.environ


def test_children_run_in_this_python(tmp_path: Path, modules: Any) -> None:
    env = modules("which", "import sys\nprint(sys.executable)\n")
    with processes.Crew(tmp_path / "logs", env) as crew:
        child = crew.start("which", "which")
        child.may_end = (0,)
        crew.wait(lambda: child.exit_code == 0, "start", 20.0)
        assert sys.executable in child.tail()
