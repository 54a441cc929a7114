"""test [PYTEST ARG …]: build, ruff, mypy and all tests; with arguments only pytest on those.

Tests that only compute run beside the others, at a low priority, and are shown after them. The last line printed is
pytest's closing line. Exit code 0 only if everything passed.
"""

from __future__ import annotations

import codecs
import os
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path

from ..bench import Bench

ORDER = 2
COMPUTING = ("tests/hidden_effects", "tests/sim", "tests/sysid")  # but for their nodes' tests, which keep time
NODES = "*_node.py"
NICE = 15
INTERRUPT_S = 15.0  # for pytest to end its node processes and to sum up


def run(bench: Bench, arguments: list[str]) -> int:
    """Set up what is missing, then check the sources and run the tests."""
    if arguments in (["-h"], ["--help"]):
        print(f"usage: ./bench {__doc__}")
        return 0
    bench.prepare()
    variables = bench.variables()
    python = str(bench.checkout.python)
    checks = {} if arguments else {"ruff": ["ruff", "check", "."], "mypy": ["mypy"]}
    failed = []
    for name, command in checks.items():
        print(f"== {name}", flush=True)
        if subprocess.call([python, "-m", *command], cwd=bench.checkout.root, env=variables):
            failed.append(name)
    print("== pytest", flush=True)
    pytest = [python, "-m", "pytest"]
    if arguments or not all((bench.checkout.root / folder).is_dir() for folder in COMPUTING):
        code, closing = _pytest([*pytest, *arguments], bench, variables)
    else:
        code, closing = _both(pytest, bench, variables)
    if failed:
        print(f"Failed before the tests, see above: {', '.join(failed)}\n{closing}", flush=True)
    return code or int(bool(failed))


def _both(pytest: list[str], bench: Bench, variables: Mapping[str, str]) -> tuple[int, str]:
    """All tests, those that only compute beside the others; the worse exit code and the last line of those."""
    root = bench.checkout.root
    keep_time = [str(d.relative_to(root)) for d in sorted((root / "tests").iterdir()) if any(d.glob("test_*.py"))]
    keep_time = [folder for folder in keep_time if folder not in COMPUTING]
    keep_time += [str(f.relative_to(root)) for folder in COMPUTING for f in sorted((root / folder).glob(NODES))]
    command = [*pytest, *COMPUTING, f"--ignore-glob={NODES}", "-p", "no:cacheprovider"]
    with tempfile.TemporaryFile() as shown:
        beside = subprocess.Popen(
            command, cwd=root, env=variables, stdout=shown, stderr=subprocess.STDOUT, preexec_fn=lambda: os.nice(NICE)
        )
        try:
            code, first = _pytest([*pytest, *keep_time], bench, variables)
            beside.wait()
        except BaseException:
            beside.kill()
            raise
        shown.seek(0)
        text = shown.read().decode(errors="replace")
    print(f"== pytest: {', '.join(COMPUTING)}\n{text}", end="", flush=True)
    lines = [line for line in text.splitlines() if line.strip()]
    if code:
        print(f"Failed before these, see above: {first}\n{lines[-1] if lines else ''}", flush=True)
    return code or beside.returncode, lines[-1] if lines else ""


def _pytest(command: list[str], bench: Bench, variables: Mapping[str, str]) -> tuple[int, str]:
    """Run pytest with its output passed through as it comes; exit code and last line."""
    terminal = sys.stdout.isatty()
    size = {"COLUMNS": str(shutil.get_terminal_size().columns)}
    colour = ["--color=yes"] if terminal else []
    decoder = codecs.getincrementaldecoder("utf-8")("replace")
    tail = ""
    root = bench.checkout.root
    here = Path.cwd() if root in Path.cwd().parents else root  # so that given paths mean what they say
    with subprocess.Popen([*command, *colour], cwd=here, env={**variables, **size}, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        try:
            while chunk := os.read(process.stdout.fileno(), 65536):
                text = decoder.decode(chunk)
                sys.stdout.write(text)
                sys.stdout.flush()
                tail = (tail + text)[-4096:]
        except KeyboardInterrupt:
            if not terminal:
                process.send_signal(signal.SIGINT)  # on a terminal it got the Ctrl-C itself
            _wait(process)
            raise
    lines = [line for line in tail.splitlines() if line.strip()]
    return process.returncode, lines[-1] if lines else ""


def _wait(process: subprocess.Popen[bytes]) -> None:
    try:
        process.wait(INTERRUPT_S)
    except subprocess.TimeoutExpired:
        process.kill()
