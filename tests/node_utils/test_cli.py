"""What all command lines share: exit codes, one line for bad input, and the list of verbs."""

from __future__ import annotations

import argparse
import subprocess
import sys
from pathlib import Path

import pytest

from hydraulic_can_driver.errors import BusDownError
from hydraulic_control.errors import ControlError
from hydraulic_node_utils import cli
from hydraulic_sim.errors import ModelError
from hydraulic_sysid.data.records import RecordError

PACKAGES = ("hydraulic_sim", "hydraulic_sysid", "hydraulic_control", "hydraulic_can_driver", "hydraulic_bringup")


def run(action: object, *arguments: str) -> int:
    parser = cli.parser("package verb", "Does things.")
    parser.add_argument("--length", type=cli.positive)
    parser.add_argument("--number", type=cli.count)
    return cli.run(parser, action, arguments)  # type: ignore[arg-type]


def raising(error: BaseException) -> object:
    def action(options: argparse.Namespace) -> int:
        raise error

    return action


@pytest.mark.parametrize(("result", "code"), [(None, 0), (0, 0), (1, 1)])
def test_the_result_is_the_exit_code(result: int | None, code: int) -> None:
    assert run(lambda options: result) == code


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (RecordError("x.csv, row 3: 'a' is no number"), 2),
        (ModelError("x.yaml: moving_mass is -1 kg"), 2),
        (ControlError("kp is -1 V/m"), 2),
        (BusDownError("CAN interface x is down"), 1),
        (cli.UsageError("--out is there"), 2),
        (FileNotFoundError(2, "No such file or directory", "x.csv"), 2),
        (OSError("no space"), 2),
    ],
)
def test_an_error_of_the_users_is_one_line_and_its_code(
    error: Exception, code: int, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(raising(error)) == code
    printed = capsys.readouterr()
    assert printed.out == "" and printed.err.startswith("package verb: ")
    assert len(printed.err.splitlines()) == 1 and "Traceback" not in printed.err


def test_an_error_of_the_system_names_its_file(capsys: pytest.CaptureFixture[str]) -> None:
    run(raising(FileNotFoundError(2, "No such file or directory", "x.csv")))
    assert capsys.readouterr().err == "package verb: x.csv: No such file or directory\n"


def test_an_error_of_the_program_is_not_hidden() -> None:
    with pytest.raises(ZeroDivisionError):
        run(raising(ZeroDivisionError()))


def test_an_interrupt_is_code_130_and_says_what_was_left(capsys: pytest.CaptureFixture[str]) -> None:
    parser = cli.parser("demo", "")
    assert cli.run(parser, raising(KeyboardInterrupt()), [], stopped="nothing runs") == 130  # type: ignore[arg-type]
    assert capsys.readouterr().err == "demo: interrupted; nothing runs\n"


@pytest.mark.parametrize(
    ("arguments", "code"),
    [
        (["--help"], 0),
        (["--nonsense"], 2),
        (["--length"], 2),
        (["--length", "0"], 2),
        (["--length", "nan"], 2),
        (["--number", "-1"], 2),
        (["--leng", "1"], 2),
    ],
)
def test_usage_is_explained(arguments: list[str], code: int, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(lambda options: 0, *arguments) == code
    assert "usage" in "".join(capsys.readouterr())


def test_numbers_of_options_are_checked() -> None:
    found: list[argparse.Namespace] = []
    run(lambda options: found.append(options), "--length", "0.5", "--number", "0")
    assert (found[0].length, found[0].number) == (0.5, 0)


def test_a_path_for_output_must_be_new_and_its_folder_there(tmp_path: Path) -> None:
    assert cli.new_path(tmp_path / "new") == tmp_path / "new"
    (tmp_path / "old").write_text("")
    (tmp_path / "broken link").symlink_to(tmp_path / "nowhere")
    assert cli.new_path(tmp_path / "old", overwrite=True) == tmp_path / "old"
    for path, said in (("old", "exists"), ("broken link", "exists"), ("no/where", "does not exist")):
        with pytest.raises(cli.UsageError, match=said):
            cli.new_path(tmp_path / path)


@pytest.mark.parametrize("package", PACKAGES)
def test_every_verb_has_a_line_of_its_own_in_the_help(package: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.run_verb(package, ["--help"]) == 0
    printed = capsys.readouterr().out
    assert cli.verbs(package)
    for name, summary in cli.verbs(package).items():
        assert summary
        assert f"  {name} " in printed and summary in printed


def test_a_verb_that_is_not_there_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.run_verb("hydraulic_sysid", ["nonsense"]) == 2
    assert "'nonsense'" in capsys.readouterr().err
    assert cli.run_verb("hydraulic_sysid", []) == 2


@pytest.mark.parametrize("package", ["hydraulic_sim", "hydraulic_sysid", "hydraulic_control"])
def test_a_package_runs_its_verbs(package: str) -> None:
    verb = next(iter(cli.verbs(package)))
    done = subprocess.run(
        [sys.executable, "-m", package, verb, "--help"], capture_output=True, text=True,
        env={"PYTHONPATH": ":".join(path for path in sys.path if path)}, timeout=500,
    )  # fmt: skip
    assert done.returncode == 0
    assert done.stdout.startswith(f"usage: {package} {verb}")


def test_output_into_a_pipe_that_closes_is_no_error(tmp_path: Path) -> None:
    script = tmp_path / "verb.py"
    script.write_text(
        "import sys\n"
        "from hydraulic_node_utils import cli\n"
        "def action(options):\n"
        "    sys.stdin.read()\n"  # ends once the reader of our output has gone
        "    print('x' * 100_000)\n"
        "sys.exit(cli.run(cli.parser('verb', ''), action, []))\n"
    )
    with subprocess.Popen(
        [sys.executable, str(script)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        env={"PYTHONPATH": ":".join(path for path in sys.path if path)},
    ) as process:  # fmt: skip
        assert process.stdin and process.stdout and process.stderr
        process.stdout.close()
        process.stdin.close()
        assert process.wait(500) == 0
        assert process.stderr.read() == b""
