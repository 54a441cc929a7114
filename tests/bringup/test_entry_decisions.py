"""The pure parts of the entry: what is decided, and what the steps of the set-up do when they fail."""

from __future__ import annotations

import io
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from hydraulic_bringup.entry import environment_plan, host, virtualenv
from hydraulic_bringup.entry.bench import Bench, with_home
from hydraulic_bringup.entry.checkout import Checkout
from hydraulic_bringup.entry.environment import build_variables, command_variables, joined
from hydraulic_bringup.entry.environment_plan import CHECKING, INSTALLING, READY, Plan, Stamp, pins, plan
from hydraulic_bringup.entry.errors import BenchError
from hydraulic_bringup.entry.findings import MISSING
from hydraulic_bringup.entry.probes import python_environment
from hydraulic_bringup.entry.ros import Ros, sourced, without_foreign
from hydraulic_bringup.entry.steps import Progress, run_step, telling_lines
from hydraulic_bringup.entry.workspace import fingerprint, staleness

ROOT = Path(__file__).resolve().parents[2]
NEED = Stamp(root="/bench", base="/usr/bin/python3.12", python="3.12", ros="wheels", pins="abc")


# --- the environment ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("found", "exists", "starts", "action", "reason"),
    [
        (None, False, False, "create", ""),
        (None, True, True, "move", "not made by ./bench"),
        (NEED, True, True, "keep", ""),
        (NEED, True, False, "create", "is gone"),
        (replace(NEED, stage=INSTALLING), True, True, "create", "not finished"),
        (replace(NEED, stage=CHECKING), True, True, "check", "not been seen to work"),
        (replace(NEED, pins="old"), True, True, "install", "pinned versions changed"),
        (replace(NEED, root="/old/place"), True, True, "create", "/old/place"),
        (replace(NEED, ros="/opt/ros/jazzy"), True, True, "create", "/opt/ros/jazzy"),
        (replace(NEED, base="/usr/bin/python3.11", python="3.11"), True, True, "create", "python3.11"),
        (replace(NEED, stage=INSTALLING, pins="old"), True, True, "create", "not finished"),
    ],
)
def test_plan(found: Stamp | None, exists: bool, starts: bool, action: str, reason: str) -> None:
    decided = plan(found, NEED, exists=exists, starts=starts)
    assert decided.action == action
    assert reason in decided.reason and bool(reason) == bool(decided.reason)


GROUPS = """\
[dependency-groups]
library = [
    "a==1",  # why
]

[tool.ruff]
line-length = 110
"""


def pins_of(tmp_path: Path, text: str) -> str:
    """`pins` of a file with `text`."""
    file = tmp_path / "pyproject.toml"
    file.write_text(text)
    return pins(file)


@pytest.mark.parametrize(
    ("old", "new", "same"),
    [
        ("a==1", "a==2", False),
        ("# why", "# another reason", True),
        ("line-length = 110", "line-length = 120", True),
        ("[tool.ruff]", "more = []\n[tool.ruff]", False),
    ],
)
def test_only_pins_change_an_environment(tmp_path: Path, old: str, new: str, same: bool) -> None:
    assert (pins_of(tmp_path, GROUPS) == pins_of(tmp_path, GROUPS.replace(old, new))) is same


def test_file_without_pins_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BenchError, match="dependency-groups"):
        pins_of(tmp_path, "[project]\n")


def test_pins_of_this_project_are_read() -> None:
    assert len(pins(ROOT / "pyproject.toml")) == 64


def test_stamp_comes_back_as_written(tmp_path: Path) -> None:
    NEED.write(tmp_path)
    assert Stamp.read(tmp_path) == NEED
    assert Stamp.read(tmp_path / "nowhere") is None


@pytest.mark.parametrize("text", ["", "{", "[]", '{"root": "/x"}', '{"complete": true}'])
def test_unreadable_stamp_stands_for_an_unfinished_set_up(tmp_path: Path, text: str) -> None:
    (tmp_path / environment_plan.STAMP).write_text(text)
    found = Stamp.read(tmp_path)
    assert found is not None and found.stage == INSTALLING


def make_checkout(root: Path) -> Checkout:
    """A checkout with pins and an empty workspace."""
    (root / "ros_ws/src").mkdir(parents=True)
    (root / "pyproject.toml").write_text(GROUPS)
    return Checkout(root)


def test_python_in_use_is_kept_whoever_calls(tmp_path: Path) -> None:
    checkout = make_checkout(tmp_path)
    checkout.venv.mkdir()
    base = tmp_path / "python3.12"
    base.touch()
    replace(NEED, base=str(base)).write(checkout.venv)
    assert environment_plan.wanted(checkout, Ros(), named=False).base == str(base)
    running = os.path.realpath(sys.executable)
    assert environment_plan.wanted(checkout, Ros(), named=True).base == running
    base.unlink()
    assert environment_plan.wanted(checkout, Ros(), named=False).base == running


def test_python_that_does_not_fit_the_sourced_ros_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BenchError, match=r"needs 3\.99"):
        environment_plan.wanted(make_checkout(tmp_path), Ros(Path("/opt/ros/jazzy"), (3, 99)), named=True)
    with pytest.raises(BenchError, match=r"needs Python 3\.99, which is not on the PATH"):
        environment_plan.wanted(make_checkout(tmp_path / "b"), Ros(Path("/opt/ros/jazzy"), (3, 99)), named=False)


@pytest.mark.parametrize(("system", "name"), [("darwin", "macOS"), ("win32", "Windows"), ("freebsd14", "freebsd14")])
def test_other_systems_are_told_so(system: str, name: str) -> None:
    host.check_system("linux")
    with pytest.raises(BenchError, match=f"runs on Linux; this is {name}"):
        host.check_system(system)


def test_other_processors_need_a_ros_of_their_own(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr("platform.machine", lambda: "aarch64")
    checkout = make_checkout(tmp_path)
    with pytest.raises(BenchError, match="no ROS 2 wheels for aarch64: they are for Linux on x86-64 alone") as refused:
        Bench(checkout, {}).prepare()
    assert "source" in refused.value.remedy and not checkout.venv.exists()
    (finding,) = python_environment.probe(Bench(checkout, {}))
    assert finding.state == MISSING and "aarch64" in finding.found
    host.check_machine("aarch64", Ros(Path("/opt/ros/jazzy"), (3, 12)))
    host.check_machine("x86_64", Ros())


class Steps:
    """Takes the place of `run_step`: keeps the titles, and fails where told to."""

    def __init__(self, failing: str = "") -> None:
        self.titles: list[str] = []
        self.commands: list[str] = []
        self.failing = failing

    def __call__(self, title: str, command: list[Any], **_: Any) -> None:
        self.titles.append(title.split()[0])
        self.commands.append(" ".join(map(str, command)))
        if self.failing and title.startswith(self.failing):
            raise BenchError(f"{title}: failed")


@pytest.fixture
def carry_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., tuple[Steps, Stamp | None]]:
    """Carries out a plan without doing its steps; the steps, and the stamp that is left."""
    checkout = make_checkout(tmp_path)

    def run(action: str, failing: str = "", ros: Ros = Ros()) -> tuple[Steps, Stamp | None]:  # noqa: B008
        steps = Steps(failing)
        monkeypatch.setattr(virtualenv, "run_step", steps)
        need = environment_plan.wanted(checkout, ros, named=True)
        try:
            virtualenv.carry_out(Plan(action), need, checkout, ros, {}, lock=0)
            assert not failing
        except BenchError:
            assert failing
        return steps, Stamp.read(checkout.venv)

    return run


def test_new_environment(carry_out: Callable[..., tuple[Steps, Stamp | None]]) -> None:
    steps, stamp = carry_out("create")
    assert steps.titles == ["Creating", "Updating", "Installing", "Starting"]
    assert "--group=library --group=ros2-wheels --group=tools" in steps.commands[2]
    assert "--system-site-packages" not in steps.commands[0]
    assert stamp is not None and stamp.stage == READY


def test_sourced_ros_brings_its_own_packages(carry_out: Callable[..., tuple[Steps, Stamp | None]]) -> None:
    steps, _ = carry_out("create", ros=Ros(Path("/opt/ros/jazzy"), sys.version_info[:2]))
    assert "--system-site-packages" in steps.commands[0]
    assert "--group=library --group=ros2-stock --group=tools" in steps.commands[2]


@pytest.mark.parametrize(
    ("failing", "stage"),
    [("Creating", INSTALLING), ("Updating", INSTALLING), ("Installing", INSTALLING), ("Starting", CHECKING)],
)
def test_half_made_environment_is_marked(
    carry_out: Callable[..., tuple[Steps, Stamp | None]], failing: str, stage: str
) -> None:
    _, stamp = carry_out("create", failing)
    assert stamp is not None and stamp.stage == stage


def test_failed_update_leaves_what_works(carry_out: Callable[..., tuple[Steps, Stamp | None]]) -> None:
    """Offline with changed pins: the next call must not throw away an environment that cannot be made again."""
    _, before = carry_out("create")
    assert before is not None
    steps, after = carry_out("install", "Installing")
    assert steps.titles == ["Updating", "Installing"]
    assert after == before


def test_check_alone_installs_nothing(carry_out: Callable[..., tuple[Steps, Stamp | None]]) -> None:
    carry_out("create", "Starting")
    steps, stamp = carry_out("check")
    assert steps.titles == ["Starting"]
    assert stamp is not None and stamp.stage == READY


def test_what_is_not_ours_is_moved_not_deleted(
    carry_out: Callable[..., tuple[Steps, Stamp | None]], tmp_path: Path
) -> None:
    for number in (1, 2):
        (tmp_path / ".venv").mkdir(exist_ok=True)
        (tmp_path / ".venv/precious").write_text(str(number))
        carry_out("move")
    assert (tmp_path / ".venv.moved-1/precious").read_text() == "1"
    assert (tmp_path / ".venv.moved-2/precious").read_text() == "2"


def test_callers_python_path_does_not_pass_as_installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[dict[str, str]] = []
    monkeypatch.setattr(virtualenv, "run_step", lambda *_, environ, **__: seen.append(dict(environ)))
    checkout = make_checkout(tmp_path)
    need = environment_plan.wanted(checkout, Ros(), named=True)
    virtualenv.carry_out(Plan("create"), need, checkout, Ros(), {"PYTHONPATH": "/x", "PIP_TARGET": "/y"}, lock=0)
    assert all("PYTHONPATH" not in environ and "PIP_TARGET" not in environ for environ in seen)


# --- ROS and variables --------------------------------------------------------------------------------------------


def fake_ros(prefix: Path, python: str = "3.12") -> Path:
    """A prefix with an rclpy in it."""
    (prefix / f"lib/python{python}/site-packages/rclpy").mkdir(parents=True)
    return prefix


def test_sourced_jazzy_is_found_behind_overlays(tmp_path: Path) -> None:
    overlay, jazzy = tmp_path / "overlay", fake_ros(tmp_path / "jazzy")
    overlay.mkdir()
    found = sourced({"ROS_DISTRO": "jazzy", "AMENT_PREFIX_PATH": f"{overlay}:{jazzy}"})
    assert found == Ros(jazzy, (3, 12))


@pytest.mark.parametrize("distro", ["humble", ""])
def test_other_distributions_are_not_jazzy(tmp_path: Path, distro: str) -> None:
    prefix = fake_ros(tmp_path / "ros")
    assert sourced({"ROS_DISTRO": distro, "AMENT_PREFIX_PATH": str(prefix)}) == Ros()


def test_wheels_in_a_virtual_environment_do_not_count_as_sourced(tmp_path: Path) -> None:
    venv = fake_ros(tmp_path / ".venv")
    (venv / "pyvenv.cfg").touch()
    assert sourced({"ROS_DISTRO": "jazzy", "AMENT_PREFIX_PATH": str(venv)}) == Ros()


def test_another_distribution_is_taken_out_of_the_variables() -> None:
    humble = {
        "ROS_DISTRO": "humble",
        "ROS_VERSION": "2",
        "ROS_DOMAIN_ID": "5",
        "AMENT_PREFIX_PATH": "/home/me/ws/install/a:/opt/ros/humble",
        "LD_LIBRARY_PATH": "/opt/ros/humble/lib:/usr/local/lib",
        "PYTHONPATH": "/opt/ros/humble/lib/python3.10/site-packages",
        "PATH": "/opt/ros/humble/bin:/usr/bin",
    }
    assert without_foreign(humble) == {
        "ROS_DOMAIN_ID": "5",
        "LD_LIBRARY_PATH": "/usr/local/lib",
        "PATH": "/usr/bin",
    }


def test_jazzy_stays_in_the_variables() -> None:
    jazzy = {"ROS_DISTRO": "jazzy", "AMENT_PREFIX_PATH": "/opt/ros/jazzy", "PATH": "/opt/ros/jazzy/bin"}
    assert without_foreign(jazzy) == jazzy


def test_home_is_given_where_there_is_none() -> None:
    assert with_home({"HOME": "/home/me"})["HOME"] == "/home/me"
    assert with_home({})["HOME"] and with_home({"HOME": ""})["HOME"]


def test_joined_keeps_each_folder_once() -> None:
    assert joined([Path("/a"), Path("/b")], "/c:/a::/d") == "/a:/b:/c:/d"


def test_variables_beside_a_sourced_ros(tmp_path: Path) -> None:
    checkout = make_checkout(tmp_path)
    environ = {"AMENT_PREFIX_PATH": "/opt/ros/jazzy", "LD_LIBRARY_PATH": "/opt/ros/jazzy/lib", "PATH": "/usr/bin"}
    variables = command_variables(checkout, Ros(Path("/opt/ros/jazzy"), (3, 12)), environ)
    assert variables["AMENT_PREFIX_PATH"] == "/opt/ros/jazzy"
    assert variables["LD_LIBRARY_PATH"] == "/opt/ros/jazzy/lib"
    assert "_ROS_WHEELS_BOOTSTRAP_COMPLETE" not in variables


def test_a_second_activation_changes_nothing(tmp_path: Path) -> None:
    checkout = make_checkout(tmp_path)
    once = command_variables(checkout, Ros(), {"PATH": "/usr/bin"})
    assert command_variables(checkout, Ros(), once) == once


def test_colcon_does_not_see_its_own_packages_below_it(tmp_path: Path) -> None:
    checkout = make_checkout(tmp_path)
    install = f"{checkout.install}/pump"
    environ = {"AMENT_PREFIX_PATH": f"{install}:/opt/ros/jazzy", "PYTHONPATH": f"{install}/lib:/ros", "PATH": "/bin"}
    variables = build_variables(checkout, Ros(Path("/opt/ros/jazzy"), (3, 12)), environ)
    assert (variables["AMENT_PREFIX_PATH"], variables["PYTHONPATH"]) == ("/opt/ros/jazzy", "/ros")
    assert "AMENT_PREFIX_PATH" not in build_variables(checkout, Ros(), environ)


def test_variables_are_those_of_the_sourced_workspace() -> None:
    """What is put together here is what colcon's own set-up file sets."""
    checkout = Checkout(ROOT)
    if not (checkout.install / "setup.sh").exists():
        pytest.skip("the workspace was not built")
    clean = {"PATH": "/usr/bin:/bin", "HOME": os.environ.get("HOME", "/")}
    script = f". {checkout.install}/setup.sh && env"
    shown = subprocess.run(["/bin/sh", "-c", script], env=clean, capture_output=True, text=True, check=True).stdout
    theirs = dict(line.split("=", 1) for line in shown.splitlines() if "=" in line)
    ours = Bench(checkout, clean).variables()
    for name in ("AMENT_PREFIX_PATH", "PYTHONPATH"):
        here = set(ours[name].split(":")) - {str(checkout.venv)}
        assert here == set(theirs[name].split(":")), name


# --- the workspace ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("last", "files", "result", "reason"),
    [
        (None, {"a": "1"}, "", "not built yet"),
        ({"key": "k", "result": "r", "files": {"a": "1"}}, {"a": "1"}, "r", ""),
        ({"key": "k", "result": "r", "files": {"a": "1"}}, {"a": "1"}, "", "not built yet"),
        ({"key": "old", "result": "r", "files": {"a": "1"}}, {"a": "1"}, "r", "Python or ROS 2 changed"),
        ({"key": "k", "result": "q", "files": {"a": "1"}}, {"a": "1"}, "r", "built by another command"),
        ({"key": "k", "result": "r", "files": {"a": "1"}}, {"a": "2"}, "r", "1 file changed"),
        ({"key": "k", "result": "r", "files": {"a": "1"}}, {"b": "1"}, "r", "2 files changed"),
    ],
)
def test_staleness(last: dict[str, Any] | None, files: dict[str, str], result: str, reason: str) -> None:
    assert staleness(last, files, "k", result) == reason


def test_fingerprint_leaves_out_what_builds_leave_behind(tmp_path: Path) -> None:
    for name in ("setup.py", "pump/a.py", "pump/__pycache__/a.pyc", "pump.egg-info/PKG-INFO", ".cache/x", ".hidden"):
        file = tmp_path / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(name)
    assert sorted(fingerprint(tmp_path)) == ["pump/a.py", "setup.py"]


# --- steps --------------------------------------------------------------------------------------------------------


def step(tmp_path: Path, code: str) -> None:
    """Run Python code as a step."""
    run_step(
        "Pumping",
        [sys.executable, "-ES", "-c", code],
        log=tmp_path / "log" / "pump.log",
        environ=os.environ,
        cwd=tmp_path,
        remedy="Add oil.",
    )


def test_step_keeps_its_output(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    step(tmp_path, "print('first'); print('last', end='')")
    assert (tmp_path / "log/pump.log").read_text().endswith("first\nlast")
    assert "Pumping: done" in capsys.readouterr().err


def test_failed_step_says_which_why_and_what_to_do(tmp_path: Path) -> None:
    with pytest.raises(BenchError) as caught:
        step(tmp_path, "print('pressure is low'); raise SystemExit(4)")
    told = str(caught.value)
    for part in ("Pumping", "exit code 4", "pressure is low", "Add oil.", "pump.log"):
        assert part in told


def test_command_that_does_not_exist_is_named(tmp_path: Path) -> None:
    with pytest.raises(BenchError, match="Cannot start /no/such/command"):
        run_step("x", ["/no/such/command"], log=tmp_path / "l", environ={}, cwd=tmp_path, remedy="")


@pytest.mark.parametrize("deaf", [False, True])
def test_interrupted_step_takes_its_children_along(tmp_path: Path, deaf: bool) -> None:
    """Also one that does not hear the signal that ends the command."""
    pid_file = tmp_path / "pid"
    code = (
        "import signal, subprocess, sys, time\n"
        f"signal.signal(signal.SIGINT, signal.{'SIG_IGN' if deaf else 'default_int_handler'})  # inherited\n"
        "child = subprocess.Popen([sys.executable, '-ES', '-c', 'import time; time.sleep(600)'])\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        f"open({str(pid_file)!r}, 'w').write(str(child.pid))\n"
        "time.sleep(600)\n"
    )

    def interrupt() -> None:
        while not (pid_file.exists() and pid_file.read_text()):
            time.sleep(0.01)
        os.kill(os.getpid(), signal.SIGINT)

    helper = threading.Thread(target=interrupt, daemon=True)
    helper.start()
    with pytest.raises(KeyboardInterrupt):
        step(tmp_path, code)
    helper.join()
    deadline = time.monotonic() + 20.0
    while _alive(int(pid_file.read_text())):
        assert time.monotonic() < deadline, "the child goes on"
        time.sleep(0.01)


def _alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


@pytest.mark.parametrize(
    ("output", "told"),
    [
        (["Collecting x", "ERROR: No matching distribution", "bye"], ["ERROR: No matching distribution"]),
        (["a", "  File 'setup.py', line 1", "SyntaxError: invalid", "noise"], ["SyntaxError: invalid"]),
        (["Failed   <<< pump", "KeyError: 1"], ["Failed   <<< pump"]),
        (["one", "two", ""], ["one", "two"]),
    ],
)
def test_telling_lines(output: list[str], told: list[str]) -> None:
    lines = telling_lines(output)
    assert set(told) <= set(lines)
    assert "noise" not in lines and "bye" not in lines


class Terminal(io.StringIO):
    """A stream that says it is a terminal."""

    def isatty(self) -> bool:
        return True


def test_progress_shows_life_on_a_terminal() -> None:
    stream = Terminal()
    progress = Progress("Pumping", stream)
    progress.detail = "bar 200"
    progress.refresh()
    progress.close("done")
    assert "\r" in stream.getvalue() and "bar 200" in stream.getvalue()
    assert "Pumping: done" in stream.getvalue().rsplit("\r", 1)[1]


def test_progress_is_quiet_in_a_log() -> None:
    stream = io.StringIO()
    progress = Progress("Pumping", stream)
    for _ in range(50):
        progress.refresh()
    assert stream.getvalue() == "Pumping ...\n"
