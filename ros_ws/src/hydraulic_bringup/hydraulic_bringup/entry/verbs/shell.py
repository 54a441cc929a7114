"""shell [-c CMD | -- CMD …]: open a shell with environment and workspace active, or run one command there."""

from __future__ import annotations

import shutil
from pathlib import Path

from ..bench import Bench
from ..environment import joined
from ..errors import UsageError

ORDER = 4

# ~/.bashrc may put other Pythons first (pyenv, conda): ours goes before them again.
BASH_START = """\
[ -f ~/.bashrc ] && . ~/.bashrc
{exports}
PS1="(bench) ${{PS1-}}"
"""


def run(bench: Bench, arguments: list[str]) -> int:
    """Set up what is missing, then become the shell or the command."""
    if arguments and arguments[0] in ("-h", "--help"):
        print(f"usage: ./bench {__doc__}")
        return 0
    command = _command(arguments)
    bench.prepare()
    variables = bench.variables()
    shell = variables.get("SHELL", "/bin/sh")
    if command is None:
        command = [shell, *_start_file(bench, shell, variables)]
    elif command[0] == "-c":
        command = ["/bin/sh", *command]
    found = shutil.which(command[0], path=variables["PATH"])
    if found is None:
        raise UsageError(f"There is no command {command[0]!r}.")
    return bench.replace_process([found, *command[1:]], variables)


def _command(arguments: list[str]) -> list[str] | None:
    if not arguments:
        return None
    if arguments[0] == "-c" and len(arguments) >= 2:
        return arguments
    if arguments[0] == "--" and len(arguments) >= 2:
        return arguments[1:]
    raise UsageError(f"./bench shell does not know {' '.join(arguments)}.", remedy="./bench shell [-c CMD | -- CMD …]")


def _start_file(bench: Bench, shell: str, variables: dict[str, str]) -> list[str]:
    if Path(shell).name != "bash":
        return []
    own = {
        "PATH": [bench.checkout.venv / "bin"],
        "PYTHONPATH": [Path(p) for p in variables.get("PYTHONPATH", "").split(":") if p],
    }
    exports = [f'export {name}="{joined(first, "")}${{{name}:+:${name}}}"' for name, first in own.items()]
    file = bench.checkout.venv / "bench.bashrc"
    file.write_text(BASH_START.format(exports="\n".join(exports)), encoding="utf-8")
    return ["--rcfile", str(file), "-i"]
