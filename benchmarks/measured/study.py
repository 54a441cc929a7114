"""What the studies share: where the data come from, the verbs that are run on them, and the row that comes out.

A study is a module of this package with

- ``SOURCE``: a `Source`, where the data are published and under which licence;
- ``EXCERPT``: the folder of `data` that is shipped and that CI diagnoses, or None where the licence allows none;
- ``study(data, work)``: takes the folder of the data and a `Work`, returns a `Row` for each machine or joint.

Column maps are those of `hydraulic_sysid/data/columns`, model files those of `models`: a user has the same.
"""

from __future__ import annotations

import importlib
import json
import subprocess
import tarfile
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from hydraulic_interfaces.errors import HydraulicError
from hydraulic_sim.arrays import Array
from hydraulic_sim.errors import SimulationError
from hydraulic_sim.model import Model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.data.records import Record

HERE = Path(__file__).parent
DATA, MODELS = HERE / "data", HERE / "models"
SEARCHED_ALL = (0, 1)  # exit codes of a verb that has done its work


class StudyError(HydraulicError):
    """Data that are not there, or a verb that could not do its work."""


@dataclass(frozen=True)
class Source:
    """A public repository with measured data."""

    repository: str
    """Address that git clones."""
    commit: str
    files: str
    """Pattern of the files within it, such as ``data/*.mat``; a study finds them under the folder that is given."""
    licence: str
    citation: str


@dataclass(frozen=True)
class Check:
    """One statement about the outcome that may turn out wrong."""

    text: str
    holds: bool


@dataclass(frozen=True)
class Row:
    """A line of `docs/measured.md`. Errors are those on data that no fit and no choice has seen."""

    machine: str
    verdict: str
    evidence: str
    error: str
    """What the errors are of, such as "position, free run [mm]"."""
    before: float
    after: float
    published: str
    known: str
    """What is known of the machine, and how the verdict was held against it."""
    checks: Sequence[Check] = ()

    @property
    def good(self) -> bool:
        return all(check.holds for check in self.checks)

    def lines(self) -> list[str]:
        """The row as it is printed, and as the page has it."""
        cells = (self.machine, self.verdict, self.error, f"{self.before:.4g}", f"{self.after:.4g}", self.published)
        return [
            "| " + " | ".join(cells) + " |",
            f"evidence: {self.evidence}",
            f"known: {self.known}",
            *(f"{'holds' if c.holds else 'DOES NOT HOLD'}: {c.text}" for c in self.checks),
        ]


@dataclass
class Work:
    """The folder of a study's results, and how verbs are run into it."""

    folder: Path
    quick: bool = False
    """Without what takes minutes: long searches, and all of a set beyond one machine."""
    machine: str | None = None
    """Of a set with several machines this one alone, …"""
    machines: list[str] = field(default_factory=list)
    """… and all that it has, as they are asked for."""
    say: Callable[[str], None] = print
    seconds: dict[str, float] = field(default_factory=dict)

    def verb(self, verb: str, *arguments: object, into: str) -> dict[str, Any]:
        """Run a verb of hydraulic_sysid as its command line does; the document that it has written.

        :param into: name of the folder of its results
        :raises StudyError: it could not do its work.
        """
        out = self.folder / into
        words = [str(a) for a in arguments]
        self.say(f"$ {verb} {' '.join(words)}")
        begin = time.perf_counter()
        code = importlib.import_module(f"hydraulic_sysid.verbs.{verb}").main([*words, "--out", str(out)])
        self.seconds[into] = time.perf_counter() - begin
        if code not in SEARCHED_ALL:
            raise StudyError(f"{verb} {' '.join(words)}: exit code {code}")
        document: dict[str, Any] = json.loads((out / f"{verb}.json").read_text("utf-8"))
        return document

    def keep(self, rows: Sequence[Row]) -> None:
        """Write the rows beside the results."""
        text = json.dumps([asdict(row) for row in rows], indent=1, ensure_ascii=False)
        (self.folder / "rows.json").write_text(text, "utf-8")

    def wanted(self, machine: str, quick: str) -> bool:
        """Whether a machine of a set is to be studied; ``quick`` is the one of a quick study."""
        self.machines.append(machine)
        return machine == (self.machine or (quick if self.quick else machine)).lower()

    def picture(
        self, name: str, series: Sequence[tuple[str, Array, dict[str, Array]]], unit: str, along: str = "s"
    ) -> Path:
        """A PNG with a panel for each of ``series``: its title, the time (N,) [s] and curves (N,) by their labels.

        The first curve is what was measured; below each panel stands what the others are off from it.
        """
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        figure = Figure(figsize=(5.2 * len(series), 5.2), layout="constrained")
        FigureCanvasAgg(figure)
        axes = figure.subplots(2, len(series), sharex="col", squeeze=False, height_ratios=(3, 2))
        for (title, at, curves), above, below in zip(series, *axes, strict=True):
            measured = next(iter(curves.values()))
            for k, (label, values) in enumerate(curves.items()):
                colour = ("black", "tab:orange", "tab:blue")[k]
                above.plot(at, values, color=colour, linewidth=1.2, label=label)
                if k:
                    below.plot(at, values - measured, color=colour, linewidth=1.0)
            above.set_title(title, fontsize=10)
            above.set_ylabel(unit)
            above.legend(fontsize=8)
            below.set_ylabel(f"error, {unit}")
            below.set_xlabel(along)
            for ax in (above, below):
                ax.grid(alpha=0.3)
        path = self.folder / f"measured_{name}.png"
        figure.savefig(path, dpi=100)
        return path


def free_run(model: Model, record: Record) -> Array:
    """Position (N,) [m] of a run over the whole record, from its first sample; NaN where the model cannot run."""
    plant = Plant(model)
    try:
        first = plant.initial_state(position=float(record["position"][0]), drive=float(record["drive"][0]))
        return plant.simulate(record["drive"], record.dt, first).position
    except SimulationError:
        return np.full(len(record), np.nan)


def rms(values: Array) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def said(document: dict[str, Any]) -> tuple[str, str]:
    """Verdict and evidence of a diagnosis, in a few words each."""
    verdict, residual = document["verdict"], document["residual"]
    named = [str(name) for name in verdict["effects"]]
    faults = [str(fault["name"]) for fault in document["recording"]["faults"]]
    data = [str(datum["key"]) for datum in document["data_sheet"]]
    what = ", ".join(named + faults + data)
    kind = str(verdict["kind"])
    if kind == "outside the library" and what:
        what = f"nearest {what}"
    before, after = (residual[when]["validation"] for when in ("before", "after"))
    return f"{kind}: {what}" if what else kind, f"{before:.3g} → {after:.3g} × noise on validation data"


def data_folder(source: Source, given: Path, into: Path) -> Path:
    """The folder under which the data of a source lie: the one that is given, or what its archives hold.

    :raises StudyError: the files are not there.
    """
    if not given.is_dir():
        raise StudyError(f"{given}: no such folder; {where(source)}")
    if any(given.rglob(Path(source.files).name)):
        return given
    archives = sorted(given.glob("*.tar*"))
    for archive in archives:
        target = into / archive.name.partition(".")[0]
        if not target.exists():
            with tarfile.open(archive) as packed:
                packed.extractall(target, filter="data")
    if any(into.rglob(Path(source.files).name)):
        return into
    unpacked = f", nor in {', '.join(a.name for a in archives)}" if archives else ""
    raise StudyError(f"{given}: no {source.files} in it{unpacked}; {where(source)}")


def fetched(source: Source, into: Path) -> Path:
    """Clone the source's repository at its commit; the folder.

    :raises StudyError: git does not get it.
    """
    target = into / "repository"
    if not (target / ".git").is_dir():
        commands = (
            ("git", "init", "--quiet", str(target)),
            ("git", "-C", str(target), "fetch", "--quiet", "--depth", "1", source.repository, source.commit),
            ("git", "-C", str(target), "checkout", "--quiet", "FETCH_HEAD"),
        )
        for command in commands:
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            if done.returncode:
                raise StudyError(f"{' '.join(command)}: {done.stderr.strip()}; {where(source)}")
    return target


def where(source: Source) -> str:
    """Where the data are to be had."""
    return f"the data are {source.files} of {source.repository} at {source.commit[:12]} (licence: {source.licence})"
