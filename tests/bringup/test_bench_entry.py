"""`./bench` from the outside, in small fake checkouts: what the user sees, exit codes, what is done how often."""

from __future__ import annotations

import fcntl
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from hydraulic_bringup.entry.checkout import Checkout
from hydraulic_bringup.entry.environment import command_variables
from hydraulic_bringup.entry.environment_plan import STAMP, Stamp, wanted
from hydraulic_bringup.entry.ros import Ros
from hydraulic_bringup.entry.verbs import test as test_verb

ROOT = Path(__file__).resolve().parents[2]
ENTRY = Path("ros_ws/src/hydraulic_bringup/hydraulic_bringup")
PATIENCE_S = 150.0
TIMING = "pytest.mark" + ".timing"

# Stands for the interpreter of the environment: writes down how it was called, and does colcon's work.
FAKE_PYTHON = """#!/bin/sh
echo "$*" >> "$CALLS"
case "$*" in
*colcon_core*)
    [ -e "$BREAK" ] && { echo "Failed   <<< pump [1.0s]"; echo "SyntaxError: bad source"; exit 3; }
    packages=$(ls src)
    case "$*" in *--packages-select*) packages=${*##*--packages-select } ;; esac
    for package in $packages; do
        [ -e "src/$package/package.xml" ] || continue
        mkdir -p "build/$package" "install/$package/share/$package" "install/$package/lib/$package"
        mkdir -p "install/$package/share/ament_index/resource_index/packages"
        cp "src/$package/package.xml" "install/$package/share/$package"
        cp -r "src/$package"/* "install/$package/lib/$package"
        touch "install/$package/share/ament_index/resource_index/packages/$package"
        echo 0 > "build/$package/colcon_build.rc"
        echo "Finished <<< $package [0.1s]"
    done ;;
*"-m ruff"*) [ ! -e "$BREAK" ] || { echo "E501 line too long"; exit 1; } ;;
*"-m mypy"*) echo "Success: no issues found" ;;
*"-m $SEEPS "*"--last-failed"*) echo "=== 3 passed, 7 deselected in 0.02s ===" ;;
*"-m $LEAKS "*|*"-m $SEEPS "*)
    echo "test_seal.py F"
    echo "=== 1 failed, 1 passed, 2 errors in 0.02s ==="
    exit 1 ;;
*"-m $BURSTS "*) echo "Segmentation fault"; exit 139 ;;
*"-m pytest"*) echo "collected 2 items"; echo "=== 2 passed, 1 warning in 0.01s ===" ;;
esac
"""


class FakeCheckout:
    """A checkout with the real entry, an environment that counts as made, and one package, `pump`."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.calls_file = root / "calls.txt"
        self.broken = root / "broken"
        self.environ = {
            "PATH": "/usr/bin:/bin",
            "HOME": str(root),
            "BENCH_PYTHON": sys.executable,
            "CALLS": str(self.calls_file),
            "BREAK": str(self.broken),
            "LEAKS": "nowhere",
            "SEEPS": "nowhere",
            "BURSTS": "nowhere",
        }
        root.mkdir(exist_ok=True)
        shutil.copy(ROOT / "bench", root)
        shutil.copy(ROOT / "pyproject.toml", root)
        skipped = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / ENTRY / "entry", root / ENTRY / "entry", ignore=skipped)
        shutil.copy(ROOT / ENTRY / "__init__.py", root / ENTRY)
        self.package = root / "ros_ws/src/pump"
        self.write("package.xml", "<package/>")
        self.write("start", '#!/bin/sh\necho "started with $*"\nenv > "$HOME/env.txt"\nexit 7\n', executable=True)
        self.write("module.py", "answer = 42\n")

    def write(self, name: str, text: str, *, executable: bool = False) -> None:
        """A file of the package."""
        file = self.package / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
        file.chmod(0o755 if executable else 0o644)

    def make_environment(self) -> None:
        """An environment as the set-up leaves it, with a fake interpreter."""
        python = self.root / ".venv/bin/python"
        python.parent.mkdir(parents=True)
        python.write_text(FAKE_PYTHON)
        python.chmod(0o755)
        wanted(Checkout(self.root), Ros(), named=True).write(self.root / ".venv")

    def bench(self, *arguments: str, cwd: Path | None = None, **environ: str) -> subprocess.CompletedProcess[str]:
        """Call `./bench`."""
        return subprocess.run(
            [str(self.root / "bench"), *arguments],
            env={**self.environ, **environ},
            cwd=cwd or self.root,
            capture_output=True,
            text=True,
            timeout=PATIENCE_S,
            check=False,
        )

    def calls(self) -> list[str]:
        """How the environment's interpreter was called since the last time."""
        lines = self.calls_file.read_text().splitlines() if self.calls_file.exists() else []
        self.calls_file.unlink(missing_ok=True)
        return lines


@pytest.fixture
def checkout(tmp_path: Path) -> FakeCheckout:
    """A fake checkout that was set up, its package not built yet."""
    fake = FakeCheckout(tmp_path / "checkout")
    fake.make_environment()
    return fake


@pytest.fixture
def built(checkout: FakeCheckout) -> FakeCheckout:
    """A fake checkout that was set up and built."""
    assert checkout.bench("build").returncode == 0
    checkout.calls()
    return checkout


# --- help and usage -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("arguments", [[], ["--help"], ["-h"], ["help"]])
def test_help_lists_every_verb_and_sets_nothing_up(tmp_path: Path, arguments: list[str]) -> None:
    fake = FakeCheckout(tmp_path / "fresh")
    shown = fake.bench(*arguments)
    assert shown.returncode == 0
    for verb in ("demo", "test", "run PKG EXE", "shell", "build", "doctor"):
        assert re.search(rf"^  {verb}\b", shown.stdout, re.MULTILINE), verb
    assert not (fake.root / ".venv").exists()


@pytest.mark.parametrize("verb", ["test", "run", "shell", "build", "doctor"])
def test_help_of_a_verb_sets_nothing_up(tmp_path: Path, verb: str) -> None:
    fake = FakeCheckout(tmp_path / "fresh")
    shown = fake.bench(verb, "--help")
    assert (shown.returncode, shown.stderr) == (0, "")
    assert f"usage: ./bench {verb}" in shown.stdout
    assert not (fake.root / ".venv").exists()


def test_unknown_verb_is_named_with_those_there_are(checkout: FakeCheckout) -> None:
    answer = checkout.bench("dmeo")
    assert answer.returncode == 2
    assert "'dmeo'" in answer.stderr and "demo, workbench, test" in answer.stderr


def test_it_is_called_from_anywhere_and_through_a_link(built: FakeCheckout, tmp_path: Path) -> None:
    link = tmp_path / "link"
    link.symlink_to(built.root / "bench")
    answer = subprocess.run(
        [link, "run", "pump", "start"], env=built.environ, cwd="/", capture_output=True, text=True, check=False
    )
    assert answer.returncode == 7, answer.stderr


# --- choice of Python ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("python", ["/bin/true", "/bin/cat", "/no/such/python"])
def test_named_python_that_is_none_is_refused(checkout: FakeCheckout, python: str) -> None:
    answer = checkout.bench("build", BENCH_PYTHON=python)
    assert answer.returncode == 1
    assert python in answer.stderr and "BENCH_PYTHON" in answer.stderr


def test_python_that_does_not_start_is_passed_over(checkout: FakeCheckout, tmp_path: Path) -> None:
    """As a shim of pyenv for a version that is not installed."""
    shims = tmp_path / "shims"
    shims.mkdir()
    shim = shims / "python3"
    shim.write_text("#!/bin/sh\necho 'pyenv: python3: command not found' >&2\nexit 127\n")
    shim.chmod(0o755)
    version = f"python3.{sys.version_info[1]}"
    (shims / version).symlink_to(os.path.realpath(sys.executable))
    answer = checkout.bench("--help", BENCH_PYTHON="", PATH=f"{shims}:/usr/bin:/bin")
    assert (answer.returncode, answer.stderr) == (0, "")


# --- run, demo, shell ---------------------------------------------------------------------------------------------


def test_run_becomes_the_executable(built: FakeCheckout) -> None:
    answer = built.bench("run", "pump", "start", "--fast", "a b")
    assert (answer.returncode, answer.stdout, answer.stderr) == (7, "started with --fast a b\n", "")


def test_executables_see_the_environment_and_the_workspace(built: FakeCheckout) -> None:
    built.bench("run", "pump", "start", ROS_DOMAIN_ID="42")
    seen = dict(line.split("=", 1) for line in (built.root / "env.txt").read_text().splitlines() if "=" in line)
    venv, installed = str(built.root / ".venv"), str(built.root / "ros_ws/install/pump")
    assert seen["PATH"].split(":")[0] == f"{venv}/bin"
    assert seen["AMENT_PREFIX_PATH"] == f"{installed}:{venv}"
    assert seen["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "LOCALHOST"
    assert seen["ROS_DOMAIN_ID"] == "42"
    assert seen["_ROS_WHEELS_BOOTSTRAP_COMPLETE"] == "1"
    assert seen["LD_LIBRARY_PATH"].split(":")[0] == f"{venv}/lib"


def test_discovery_range_of_the_user_is_kept(built: FakeCheckout) -> None:
    built.bench("run", "pump", "start", ROS_AUTOMATIC_DISCOVERY_RANGE="SUBNET")
    assert "ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET\n" in (built.root / "env.txt").read_text()


@pytest.mark.parametrize(
    ("given", "profile"),
    [
        ({}, "fastdds.xml"),
        ({"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}, "fastdds_network.xml"),
        ({"FASTRTPS_DEFAULT_PROFILES_FILE": "/theirs.xml"}, "theirs.xml"),
        ({"FASTDDS_DEFAULT_PROFILES_FILE": "/theirs.xml"}, None),
    ],
)
def test_sockets_stay_on_this_machine_by_default(given: dict[str, str], profile: str | None) -> None:
    seen = command_variables(Checkout(ROOT), Ros(), given).get("FASTRTPS_DEFAULT_PROFILES_FILE")
    assert (seen and Path(seen).name) == profile


def test_run_hands_over_to_ros2_where_it_is_installed(built: FakeCheckout, tmp_path: Path) -> None:
    tool = tmp_path / "tools" / "ros2"
    tool.parent.mkdir()
    tool.write_text('#!/bin/sh\necho "ros2 $*"\n')
    tool.chmod(0o755)
    answer = built.bench("run", "pump", "start", "-x", PATH=f"{tool.parent}:/usr/bin:/bin")
    assert answer.stdout == "ros2 run pump start -x\n"


def test_unknown_package_and_executable_are_named_with_those_there_are(built: FakeCheckout) -> None:
    package = built.bench("run", "pmup", "start")
    executable = built.bench("run", "pump", "strat")
    nothing = built.bench("run")
    assert [a.returncode for a in (package, executable, nothing)] == [2, 2, 2]
    assert "'pmup'" in package.stderr and "pump" in package.stderr.splitlines()[1]
    assert "'strat'" in executable.stderr and "start" in executable.stderr.splitlines()[1]
    assert "pump: start" in nothing.stderr


def test_demo_is_an_executable_of_the_top_floor(built: FakeCheckout) -> None:
    answer = built.bench("demo", "--quick")
    assert answer.returncode == 2
    assert "'hydraulic_bringup'" in answer.stderr  # the fake workspace has no such package


@pytest.mark.parametrize("first", [[], ["--", "sh"]])
def test_shell_runs_a_command(built: FakeCheckout, first: list[str]) -> None:
    answer = built.bench("shell", *first, "-c", "echo $VIRTUAL_ENV; exit 5")
    assert (answer.returncode, answer.stdout) == (5, f"{built.root / '.venv'}\n")


def test_shell_opens_the_shell_of_the_user(built: FakeCheckout) -> None:
    answer = built.bench("shell", SHELL="/bin/echo")
    assert answer.returncode == 0


def test_interactive_bash_keeps_the_environment_first(built: FakeCheckout) -> None:
    (built.root / ".bashrc").write_text("PATH=/first/of/all:$PATH\n")
    answer = subprocess.run(
        [str(built.root / "bench"), "shell"],
        env={**built.environ, "SHELL": "/bin/bash"},
        input="echo path=$PATH\n",
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        check=False,
    )
    assert f"path={built.root}/.venv/bin:/first/of/all" in answer.stdout


@pytest.mark.parametrize("arguments", [["-c"], ["--"], ["ls"]])
def test_shell_refuses_what_it_does_not_know(built: FakeCheckout, arguments: list[str]) -> None:
    assert built.bench("shell", *arguments).returncode == 2


def test_a_pipe_whose_reader_leaves_ends_quietly(built: FakeCheckout) -> None:
    """Python ignores SIGPIPE; what it becomes must not, or `yes` complains."""
    answer = built.bench("shell", "-c", "yes | head -n 1")
    assert (answer.stdout, answer.stderr) == ("y\n", "")


# --- build: what is done how often --------------------------------------------------------------------------------


def test_first_call_builds_the_second_does_nothing(checkout: FakeCheckout) -> None:
    first = checkout.bench("build")
    assert first.returncode == 0
    assert "Building the workspace" in first.stderr
    assert len(checkout.calls()) == 1
    second = checkout.bench("build")
    assert (second.returncode, second.stderr) == (0, "")
    assert checkout.calls() == []


def test_every_verb_that_needs_it_builds(checkout: FakeCheckout) -> None:
    assert checkout.bench("run", "pump", "start").returncode == 7


def test_changed_package_is_built_alone(built: FakeCheckout) -> None:
    other = built.root / "ros_ws/src/valve/package.xml"
    other.parent.mkdir()
    other.write_text("<package/>")
    built.bench("build")
    assert built.calls()[-1].endswith("build --packages-select valve")
    built.write("module.py", "answer = 43\n")
    built.bench("build")
    assert built.calls()[-1].endswith("build --packages-select pump")
    built.bench("build")
    assert built.calls() == []


def test_touched_file_is_no_change(built: FakeCheckout) -> None:
    os.utime(built.package / "module.py", (1, 1))
    (built.package / "__pycache__").mkdir()
    (built.package / "__pycache__/module.pyc").write_bytes(b"x")
    built.bench("build")
    assert built.calls() == []


def test_deleted_module_is_gone_after_the_build(built: FakeCheckout) -> None:
    installed = built.root / "ros_ws/install/pump/lib/pump/module.py"
    assert installed.exists()
    (built.package / "module.py").unlink()
    built.bench("build")
    assert not installed.exists()


def test_build_by_another_python_leaves_nothing_behind(built: FakeCheckout) -> None:
    remains = built.root / "ros_ws/install/pump/lib/python3.9/site-packages"
    remains.mkdir(parents=True)
    stamp = built.root / "ros_ws/build" / STAMP
    stamp.write_text(stamp.read_text().replace("Python 3.", "Python 2."))
    built.bench("build")
    assert len(built.calls()) == 1
    assert not remains.exists()


@pytest.mark.parametrize("lost", ["install/pump", "install", "build", "build/pump/colcon_build.rc"])
def test_lost_result_is_built_again(built: FakeCheckout, lost: str) -> None:
    place = built.root / "ros_ws" / lost
    shutil.rmtree(place) if place.is_dir() else place.unlink()
    built.bench("build")
    assert len(built.calls()) == 1


def test_plain_colcon_build_is_noticed(built: FakeCheckout) -> None:
    """It may have used another Python, which the executables would then start."""
    os.utime(built.root / "ros_ws/build/pump/colcon_build.rc", (1, 1))
    built.bench("build")
    assert len(built.calls()) == 1


def test_all_builds_everything(built: FakeCheckout) -> None:
    built.bench("build", "--all")
    assert built.calls()[-1].endswith("sys.exit(main()) build")


def test_failed_build_says_which_why_and_what_to_do_and_is_tried_again(checkout: FakeCheckout) -> None:
    checkout.broken.touch()
    answer = checkout.bench("run", "pump", "start")
    assert answer.returncode == 1
    for told in ("Building the workspace", "exit code 3", "SyntaxError: bad source", "do:", "build.log"):
        assert told in answer.stderr
    assert "Traceback" not in answer.stderr
    checkout.broken.unlink()
    assert checkout.bench("run", "pump", "start").returncode == 7


# --- test ---------------------------------------------------------------------------------------------------------


def test_all_tests_run_those_of_the_wall_clock_last_and_the_closing_line_sums_up(built: FakeCheckout) -> None:
    for name, text in (("pace", f"@{TIMING}"), ("seal", "")):
        file = built.root / f"tests/pump/test_{name}.py"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
    answer = built.bench("test")
    assert answer.returncode == 0, answer.stderr
    calls = [re.sub(r"-o cache_dir=\S+ | -n \d+", "", call) for call in built.calls()]
    assert sum(call.startswith("-c from hydraulic_sim") for call in calls) == 1, "compiled once, beside the checks"
    assert [call for call in calls if not call.startswith("-c ")] == [
        "-m ruff check .",
        "-m mypy",
        "-m pytest -m not timing and not thorough -p xdist --dist=loadfile --no-loadscope-reorder tests",
        "-m pytest -m timing tests/pump/test_pace.py",
    ]
    assert answer.stdout.count("collected 2 items") == 2
    assert answer.stdout.splitlines()[-1].startswith("=== 4 passed, 2 warnings in ")


def test_thorough_tests_are_left_out_and_said_to_be_but_for_the_option(built: FakeCheckout) -> None:
    assert "./bench test --thorough" in built.bench("test").stdout
    answer = built.bench("test", "--thorough")
    assert answer.returncode == 0, answer.stderr
    without, whole = (call for call in built.calls() if "-m not timing" in call)
    assert "-m not timing and not thorough -p" in without and "thorough" not in whole
    assert "--thorough" not in answer.stdout


def test_test_with_arguments_runs_only_pytest(built: FakeCheckout) -> None:
    answer = built.bench("test", "-k", "plant")
    assert answer.returncode == 0
    assert built.calls() == ["-m pytest -k plant"]
    assert answer.stdout.splitlines()[-1] == "=== 2 passed, 1 warning in 0.01s ==="


def test_failed_check_fails_the_test_and_the_closing_line_stays_last(built: FakeCheckout) -> None:
    built.broken.touch()
    answer = built.bench("test")
    assert answer.returncode == 1
    assert "ruff" in answer.stdout.splitlines()[-2]
    assert answer.stdout.splitlines()[-1].startswith("=== 4 passed")


def test_only_tests_of_the_wall_clock_are_repeated(built: FakeCheckout) -> None:
    answer = built.bench("test", SEEPS="timing")
    timing = [call for call in built.calls() if "-m timing" in call]
    assert timing[1:] == [f"{timing[0]} --last-failed"], "it knows from the first what failed"
    assert answer.returncode == 0
    assert "test_seal.py F" in answer.stdout
    assert answer.stdout.splitlines()[-1].startswith("=== 6 passed, 3 repeated, 1 warnings in ")


def test_what_protects_the_bench_is_not_among_them() -> None:
    """Gate, faults, contract and control have to pass at once; a further file gets here on purpose or not at all."""
    files = [file for file in (ROOT / "tests").rglob("test_*.py") if TIMING in file.read_text()]
    assert {str(file.relative_to(ROOT / "tests")) for file in files} == {
        "can_driver/test_sync.py",
        "plant_node/test_lockstep.py",
        "plant_node/test_plant_loop.py",
        "system/test_vcan.py",
        "workbench/page/test_redraws.py",  # per second
        "workbench/page/test_without_plant.py",  # the first paint
        "workbench/test_workbench_node.py",  # milliseconds from the stop button to 0 V
    }
    assert not re.search(r"rerun|flaky|repeat", (ROOT / "pyproject.toml").read_text().partition("[tool.")[0])


@pytest.mark.parametrize("deaf", [False, True])
def test_what_hangs_is_interrupted_and_has_failed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], deaf: bool
) -> None:
    """What it has found is told; a child that it leaves behind keeps nobody waiting."""
    monkeypatch.setattr(test_verb, "LONGEST_S", 1.0)
    monkeypatch.setattr(test_verb, "INTERRUPT_S", 1.0 if deaf else PATIENCE_S)
    trap = "''" if deaf else "'echo === 2 failed in 1 s ===; exit 2'"
    hung = f"trap {trap} INT; echo test_seal.py F; sleep 60 & while true; do sleep 0.1; done"
    begun = time.monotonic()
    run = test_verb.Pytest(["sh", "-c", hung], tmp_path, dict(os.environ))
    assert run.code == (-signal.SIGKILL if deaf else 2)
    assert "test_seal.py F" in capfd.readouterr().out
    assert test_verb.summed([run.counted], 1.0).startswith("=== 1 errors" if deaf else "=== 2 failed")
    assert time.monotonic() - begun < 30.0, "it waited for the child"


def test_tests_that_somebody_asks_for_may_take_as_long_as_they_do(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A debugger stands still for an hour."""
    monkeypatch.setattr(test_verb, "LONGEST_S", 0.2)
    slow = ["sh", "-c", "sleep 1.5; echo === 1 passed in 1.5 s ==="]
    assert test_verb.Pytest(slow, tmp_path, dict(os.environ), longest=60.0).code == 0
    assert test_verb.Pytest(slow, tmp_path, dict(os.environ)).code != 0


@pytest.mark.parametrize("marker", ["not timing and not thorough", "timing"])
def test_whichever_run_fails_fails_the_test(built: FakeCheckout, marker: str) -> None:
    leaks = built.bench("test", LEAKS=marker)
    assert leaks.returncode == 1
    counts = leaks.stdout.splitlines()[-1].partition(" in ")[0]
    again = ", 3 repeated" if marker == "timing" else ""  # and in vain
    passed = 4 if marker == "timing" else 3
    assert counts == f"=== 1 failed, {passed} passed{again}, 1 warnings, 2 errors"
    assert "test_seal.py F" in leaks.stdout
    assert ("--last-failed" in "".join(built.calls())) == (marker == "timing")
    bursts = built.bench("test", BURSTS=marker)
    assert bursts.returncode == 139
    assert bursts.stdout.splitlines()[-1].startswith("=== 2 passed, 1 warnings, 1 errors in ")
    assert "Segmentation fault" in bursts.stdout


# --- lock, interrupts, damage -------------------------------------------------------------------------------------


@pytest.fixture
def waiting(checkout: FakeCheckout) -> Iterator[Callable[[], subprocess.Popen[str]]]:
    """Starts a `./bench build` that waits, because a lock is held; lets go of the lock at the end."""
    lock = checkout.root / "ros_ws/log/bench/lock"
    lock.parent.mkdir(parents=True)
    started: list[subprocess.Popen[str]] = []

    def start() -> subprocess.Popen[str]:
        process = subprocess.Popen(
            [checkout.root / "bench", "build"],
            env=checkout.environ,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        started.append(process)
        assert process.stderr is not None
        assert "Waiting for another ./bench" in process.stderr.readline()
        return process

    with lock.open("w") as handle:
        fcntl.flock(handle, fcntl.LOCK_EX)
        yield start
    for process in started:
        process.kill()
        process.communicate()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("inherited", [signal.SIG_DFL, signal.SIG_IGN])
def test_interrupt_ends_it_cleanly(
    waiting: Callable[[], subprocess.Popen[str]], number: signal.Signals, inherited: signal.Handlers
) -> None:
    """Also as a background job of a script, which starts with SIGINT ignored."""
    before = signal.signal(signal.SIGINT, inherited)
    try:
        process = waiting()
    finally:
        signal.signal(signal.SIGINT, before)
    process.send_signal(number)
    _, errors = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 130
    assert "bench: stopped." in errors and "Traceback" not in errors


def test_second_call_waits_and_finds_the_work_done(checkout: FakeCheckout) -> None:
    lock = checkout.root / "ros_ws/log/bench/lock"
    lock.parent.mkdir(parents=True)
    with lock.open("w") as handle:
        fcntl.flock(handle, fcntl.LOCK_EX)
        both = [
            subprocess.Popen(
                [checkout.root / "bench", "build"],
                env=checkout.environ,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE,
                text=True,
            )
            for _ in range(2)
        ]
        for process in both:
            assert process.stderr is not None
            assert "Waiting" in process.stderr.readline()
    for process in both:
        process.communicate(timeout=PATIENCE_S)
        assert process.returncode == 0
    assert len(checkout.calls()) == 1


def test_unexpected_error_is_one_line_with_the_details_in_a_file(built: FakeCheckout) -> None:
    verb = built.root / ENTRY / "entry/verbs/build.py"
    verb.write_text('"""build: x."""\nORDER = 1\ndef run(bench, arguments):\n    return 1 / 0\n')
    answer = built.bench("build")
    assert answer.returncode == 1
    assert "ZeroDivisionError" in answer.stderr and "Traceback" not in answer.stderr
    assert "Traceback" in (built.root / "ros_ws/log/bench/error.log").read_text()


def test_python_without_venv_is_named_with_what_to_install(tmp_path: Path) -> None:
    fake = FakeCheckout(tmp_path / "fresh")
    shim = tmp_path / "bare-python"
    shim.write_text(f'#!/bin/sh\ncase "$*" in *ensurepip*) exit 1;; esac\nexec "{sys.executable}" "$@"\n')
    shim.chmod(0o755)
    stamp = Stamp(str(fake.root), str(shim), "3.11", "wheels", "", stage="installing")
    (fake.root / ".venv").mkdir()
    stamp.write(fake.root / ".venv")
    answer = fake.bench("build", BENCH_PYTHON="", PATH="/usr/bin:/bin")
    assert answer.returncode == 1
    assert "cannot make virtual environments" in answer.stderr and "apt install" in answer.stderr


# --- doctor -------------------------------------------------------------------------------------------------------


def test_doctor_runs_before_anything_is_set_up(tmp_path: Path) -> None:
    fake = FakeCheckout(tmp_path / "fresh")
    answer = fake.bench("doctor")
    assert answer.returncode == 0, answer.stdout
    subjects = "interpreter environment workspace discovery SocketCAN python-can can-utils clock sleep"
    for subject in subjects.split():
        assert re.search(rf"^  (ok|note) +{subject}\b", answer.stdout, re.MULTILINE), subject
    assert "not made yet" in answer.stdout and "The bench can run." in answer.stdout
    assert not (fake.root / ".venv").exists()


def test_doctor_names_what_keeps_the_bench_from_running(checkout: FakeCheckout) -> None:
    python = checkout.root / ".venv/bin/python"
    python.write_text("#!/bin/sh\necho 'ModuleNotFoundError: No module named rclpy' >&2\nexit 1\n")
    answer = checkout.bench("doctor")
    assert answer.returncode == 1
    assert "No module named rclpy" in answer.stdout and "The bench cannot run: imports." in answer.stdout


def test_stamp_is_not_taken_for_a_made_environment_when_unreadable(checkout: FakeCheckout) -> None:
    (checkout.root / ".venv" / STAMP).write_text("{")
    assert "not finished" in checkout.bench("doctor").stdout
