"""Which effect files a model file may name: they are Python, and reading the model runs them.

Allowed are files in the model file's own folder or below it, in this project, and in folders that the user trusts:
``--trust DIR`` of a verb, or the environment variable `VARIABLE` (folders with a colon between), which nodes read too.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from .errors import EffectError

VARIABLE = "HYDRAULIC_TRUSTED"


def check_trusted(effect: Path, model: Path) -> None:
    """Check that a model file may name an effect file; links of both are followed.

    :raises EffectError: it lies elsewhere.
    """
    file = effect.resolve()
    if not any(file.is_relative_to(folder) for folder in (*_own(model), *_project(), *trusted())):
        raise EffectError(
            f"{file} is not run: it lies outside the model file's folder {model.resolve().parent}; allowed are files "
            f"there, in this project, and in folders that you trust: --trust {file.parent}, or {VARIABLE}={file.parent}"
        )


def trusted() -> tuple[Path, ...]:
    """The folders that the user trusts, links followed; names that are not absolute count from the working folder."""
    named = os.environ.get(VARIABLE, "").split(os.pathsep)
    return tuple(Path(folder).expanduser().resolve() for folder in named if folder)


def add_trust_option(parser: argparse.ArgumentParser) -> None:
    """``--trust DIR``, for this process and those that it starts."""
    parser.add_argument(
        "--trust",
        metavar="DIR",
        action=_Trust,
        help="run effect files of this folder that a model file names; may be repeated (default: only those of its own "
        "folder and of this project)",
    )


class _Trust(argparse.Action):
    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: str | Sequence[Any] | None,
        option_string: str | None = None,
    ) -> None:
        folder = Path(str(values)).expanduser().resolve()
        if not folder.is_dir():
            parser.error(f"--trust {values}: there is no such folder")
        if os.pathsep in str(folder):
            parser.error(f"--trust {values}: the folder's name must not hold {os.pathsep!r}")
        os.environ[VARIABLE] = os.pathsep.join(filter(None, (os.environ.get(VARIABLE, ""), str(folder))))


def _own(model: Path) -> tuple[Path, ...]:
    """The model file's folder: where it is, and where a link stands that leads to it."""
    return model.resolve().parent, model.parent.resolve()


def _project() -> tuple[Path, ...]:
    """The installed package, and the checkout around it where it runs from one."""
    package = Path(__file__).resolve().parent
    checkout = package.parents[1]
    return (package, checkout) if (checkout / "ros_ws" / "src").is_dir() else (package,)
