"""What all verbs share: exit codes, one line for bad input, and the list of verbs."""

from __future__ import annotations

import argparse
import subprocess
import sys
from pathlib import Path

import pytest

from hydraulic_sim.errors import ModelError
from hydraulic_sysid.__main__ import main, summary, verb_names
from hydraulic_sysid.data.records import RecordError
from hydraulic_sysid.verbs import _cli as cli


def run(action: object, *arguments: str) -> int:
    parser = cli.parser("verb", "Does things.")
    cli.add_record_options(parser, required=False)
    cli.add_output_options(parser, "nothing")
    return cli.run(parser, action, arguments)  # type: ignore[arg-type]


def raising(error: BaseException) -> object:
    def action(options: argparse.Namespace) -> int:
        raise error

    return action


@pytest.mark.parametrize(("result", "code"), [(None, 0), (0, 0), (1, 1)])
def test_the_result_is_the_exit_code(result: int | None, code: int) -> None:
    assert run(lambda options: result) == code


@pytest.mark.parametrize(
    "error",
    [
        RecordError("x.csv, row 3: 'a' is no number"),
        ModelError("x.yaml: moving_mass is -1 kg"),
        cli.UsageError("--out is there"),
        FileNotFoundError(2, "No such file or directory", "x.csv"),
    ],
)
def test_bad_input_is_one_line_and_code_2(error: Exception, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(raising(error)) == cli.BAD_INPUT
    printed = capsys.readouterr()
    assert printed.out == "" and printed.err.startswith("hydraulic_sysid verb: ")
    assert len(printed.err.splitlines()) == 1 and "Traceback" not in printed.err


def test_an_error_of_the_program_is_not_hidden() -> None:
    with pytest.raises(ZeroDivisionError):
        run(raising(ZeroDivisionError()))


def test_an_interrupt_is_code_130(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(raising(KeyboardInterrupt())) == cli.INTERRUPTED
    assert "interrupted" in capsys.readouterr().err


@pytest.mark.parametrize(("arguments", "code"), [(["--help"], 0), (["--nonsense"], 2), (["--record"], 2)])
def test_usage_is_explained(arguments: list[str], code: int, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(lambda options: 0, *arguments) == code
    assert "usage" in "".join(capsys.readouterr())


def test_records_may_be_named_together_or_one_by_one() -> None:
    found: list[Path] = []
    run(lambda options: found.extend(options.record), "--record", "a", "b", "--record", "c")
    assert found == [Path("a"), Path("b"), Path("c")]


def test_a_path_for_output_must_be_new_and_its_folder_there(tmp_path: Path) -> None:
    assert cli.new_path(tmp_path / "new") == tmp_path / "new"
    (tmp_path / "old").write_text("")
    assert cli.new_path(tmp_path / "old", overwrite=True)
    for path, said in (("old", "exists"), ("no/where", "does not exist")):
        with pytest.raises(cli.UsageError, match=said):
            cli.new_path(tmp_path / path)


def test_every_verb_has_a_line_of_its_own_in_the_help(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--help"]) == 0
    printed = capsys.readouterr().out
    for name in verb_names():
        assert f"{name} " in printed and summary(name) in printed and summary(name)


def test_a_verb_that_is_not_there_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["nonsense"]) == 2
    assert "'nonsense'" in capsys.readouterr().err
    assert main([]) == 2


def test_output_into_a_pipe_that_closes_is_no_error(tmp_path: Path) -> None:
    script = tmp_path / "verb.py"
    script.write_text(
        "import sys\n"
        "from hydraulic_sysid.verbs import _cli as cli\n"
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
        assert process.wait(60) == 0
        assert process.stderr.read() == b""
