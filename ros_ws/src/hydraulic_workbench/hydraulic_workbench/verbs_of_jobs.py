"""What the page may run: verbs of hydraulic_sysid, and the command line of each from what the page asks for."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from hydraulic_workbench.errors import WorkbenchError


@dataclass(frozen=True)
class Asked:
    """What a page asks of a verb, with files instead of identifiers."""

    model: Path
    records: Sequence[tuple[Path, Path | None]] = ()
    """Files and column maps."""
    holdout: Sequence[tuple[Path, Path | None]] = ()
    plan: Path | None = None
    diagnosis: Path | None = None
    options: Mapping[str, Any] = field(default_factory=dict)

    @property
    def columns(self) -> list[str]:
        """The option of the column map that all tables share.

        :raises WorkbenchError: they have several.
        """
        maps = {columns for _, columns in (*self.records, *self.holdout)}
        named = maps - {None}
        if len(named) > 1 or (named and None in maps and any(c is None and f.is_file() for f, c in self.records)):
            raise WorkbenchError(
                "records with different column maps cannot go into one run; take them in turn", "records"
            )
        return ["--columns", str(*named)] if named else []

    def record_options(self, holdout: str = "") -> list[str]:
        """``--record …``, ``--columns``, and the records that are held out, where the verb has an option for them."""
        if not self.records:
            raise WorkbenchError("choose at least one record", "records")
        if self.holdout and not holdout:
            raise WorkbenchError("this verb holds no records out", "holdout")
        held = [holdout, *(str(f) for f, _ in self.holdout)] if self.holdout else []
        return ["--record", *(str(file) for file, _ in self.records), *self.columns, *held]


Line = Callable[[Asked], list[str]]


def _model_and_records(asked: Asked, holdout: str = "") -> list[str]:
    return ["--model", str(asked.model), *asked.record_options(holdout)]


def _diagnose(asked: Asked) -> list[str]:
    within = asked.options.get("within")
    return [
        *_model_and_records(asked, "--holdout"),
        "--apply",
        *(["--within", str(_number(within, "within"))] if within else []),
        *(["--quick"] if asked.options.get("quick") else []),
    ]


def _add(asked: Asked) -> list[str]:
    effect = asked.options.get("effect")
    if not isinstance(effect, str) or not effect.isidentifier():
        raise WorkbenchError(f"effect is {effect!r}; it must be the name of an effect of the library", "effect")
    return [effect, *_model_and_records(asked, "--holdout")]


def _next_experiment(asked: Asked) -> list[str]:
    if asked.diagnosis is None:
        raise WorkbenchError("next_experiment needs the diagnosis whose question it is to answer", "run")
    seconds = asked.options.get("seconds")
    return ["--diagnosis", str(asked.diagnosis), *(["--seconds", str(_number(seconds, "seconds"))] if seconds else [])]


def _design(asked: Asked) -> list[str]:
    signal, options = asked.options.get("signal"), asked.options
    if not isinstance(signal, str) or not signal.isidentifier():
        raise WorkbenchError(f"signal is {signal!r}; it must be the name of a signal", "signal")
    line = [signal, "--model", str(asked.model)]
    for name in ("duration", "part", "seed", "centre"):
        if options.get(name) is not None:
            line += [f"--{name}", f"{_number(options[name], name):g}"]
    if (band := options.get("band")) is not None:
        if not isinstance(band, list) or len(band) != 2:
            raise WorkbenchError(f"band is {band!r}; it must be two frequencies in Hz", "band")
        line += ["--band", *(str(_number(one, "band")) for one in band)]
    return line


def _rehearse(asked: Asked) -> list[str]:
    if asked.plan is None:
        raise WorkbenchError("choose a plan to rehearse", "plan")
    line = [str(asked.plan), "--model", str(asked.model)]
    if (position := asked.options.get("position")) is not None:
        line += ["--position", f"{_number(position, 'position'):.6f}"]
    return line


@dataclass(frozen=True)
class Verb:
    """A verb: its command line, whether it takes long, and whether it leaves a model to go on with."""

    line: Line
    heavy: bool = True
    leads_to_model: str = ""
    """What the timeline says of the model that it writes; empty where it writes none, or none by itself."""
    ends_early: bool = False
    """Whether it ends with the best so far when it is interrupted."""


VERBS: dict[str, Verb] = {
    "calibrate": Verb(lambda asked: _model_and_records(asked, "--holdout-record"), leads_to_model="calibrated"),
    "check": Verb(lambda asked: ["--check", *_model_and_records(asked)], heavy=False),
    "compare": Verb(lambda asked: [*_model_and_records(asked), "--samples"], heavy=False),
    "locate": Verb(_model_and_records, heavy=False),
    "diagnose": Verb(_diagnose, ends_early=True),
    "add": Verb(_add, leads_to_model="added"),
    "next_experiment": Verb(_next_experiment),
    "identify": Verb(lambda asked: asked.record_options(), heavy=False),
    "design": Verb(_design, heavy=False),
    "rehearse": Verb(_rehearse, heavy=False),
}
OTHERWISE = {"check": "calibrate"}
"""Verbs that are another one with an option."""


def command(verb: str, asked: Asked, out: Path) -> list[str]:
    """The command line of a run, after ``python -m hydraulic_sysid``.

    :raises WorkbenchError: no such verb, or what it needs is not there.
    """
    if verb not in VERBS:
        raise WorkbenchError(f"verb is {verb!r}; allowed are {', '.join(VERBS)}", "verb")
    line = VERBS[verb].line(asked)
    return [OTHERWISE.get(verb, verb), *line, "--out", str(out)]


def _number(value: Any, name: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < float("inf"):
        raise WorkbenchError(f"{name} is {value!r}; it must be a number", name)
    return float(value)
