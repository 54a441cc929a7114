"""``demo``: the main job in one go, on the simulated actuator or on records of your own.

Without options: a simulated actuator, built a little differently from its data sheet, is excited and recorded
through the node graph; a linear model is identified; the data-sheet model is compared with the measurement; and
a page says where it fails. With ``--record`` and ``--model`` the same from there on for records that exist.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from functools import partial
from importlib import resources
from importlib.util import find_spec
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from hydraulic_bringup.demo import offline, online
from hydraulic_node_utils import cli, tables
from hydraulic_sim.model_file import load_model
from hydraulic_sim.trust import add_trust_option
from hydraulic_sysid.data.display import number
from hydraulic_sysid.data.records import read_all
from hydraulic_sysid.verbs.compare import error_table

DATA_SHEET = "moog_mcr_m_1002_bench"
RUNS = Path("runs")
WORKBENCH = "hydraulic_workbench.nodes.workbench"
"""Of the floor above, which need not be there."""
_OFFLINE_S = 14.0
SHOWN = ("position", "velocity", "load_pressure")  # channels of the table; all are in the report


class ProgressSteps:
    """Shows steps of known length as one bar; a plain line for each where there is no terminal."""

    def __init__(self, console: Console, total_s: float) -> None:
        columns = (SpinnerColumn(), TextColumn("{task.description:36}"), BarColumn(), TimeElapsedColumn())
        self._console = console
        self._bar = Progress(*columns, console=console, transient=True, disable=not console.is_terminal)
        self._task = self._bar.add_task("", total=total_s)
        self._before, self._length, self._begun, self._text = 0.0, 0.0, 0.0, ""

    def __enter__(self) -> ProgressSteps:
        self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.stop()

    def begin(self, text: str, seconds: float) -> None:
        """A step that will take about so long."""
        self._text, self._length, self._begun = text, seconds, time.monotonic()
        self._bar.update(self._task, description=text)

    def tick(self) -> None:
        """Time goes by within the step."""
        part = min((time.monotonic() - self._begun) / self._length, 0.98)
        self._bar.update(self._task, completed=self._before + part * self._length)

    def done(self) -> None:
        """The step is finished."""
        self._before += self._length
        self._bar.update(self._task, completed=self._before)
        self._console.print(f"  {self._text:36} {time.monotonic() - self._begun:5.1f} s", highlight=False)

    def say(self, text: str) -> None:
        """Something that the user should know."""
        self._console.print(f"  {text}", markup=False)


def main(argv: list[str] | None = None) -> int:
    """Run the demo; 0 done, 1 a step failed, 2 bad options or input, 130 interrupted."""
    shown: list[Path] = []
    code = cli.run(_parser(), partial(_demo, shown), argv, stopped="every process of the demo has been stopped")
    online.take_down_left(code)
    for folder in shown:
        os.execv(sys.executable, [sys.executable, "-m", WORKBENCH, "--open", str(folder)])
    return code


def _demo(shown: list[Path], options: argparse.Namespace) -> None:
    """Run it; ``shown`` takes the folder that the workbench is to open."""
    if options.workbench and find_spec(WORKBENCH.partition(".")[0]) is None:
        raise cli.UsageError("--workbench: the package hydraulic_workbench is not there")
    if options.columns and not options.record:
        raise cli.UsageError("--columns: goes with --record only")
    if options.record and (options.quick or options.plant or options.lockstep is not None):
        raise cli.UsageError("--record: nothing is excited then, so --plant, --quick and --lockstep do not go with it")
    options.plant = options.plant or "sim"
    options.lockstep = options.lockstep is not False
    online.interrupt_on_sigterm()
    out = _run(options, Console(highlight=False))
    if options.workbench:
        shown.append(out)


def _parser() -> argparse.ArgumentParser:
    parser = cli.parser("demo", __doc__)
    parser.add_argument(
        "--record", nargs="+", metavar="PATH", help="records that exist: bag, CSV, MAT, or a folder of such"
    )
    parser.add_argument("--columns", metavar="MAP", help="column map of records that are tables")
    parser.add_argument(
        "--model", metavar="FILE", default=DATA_SHEET, help=f"model file or preset (default {DATA_SHEET})"
    )
    add_trust_option(parser)
    parser.add_argument("--plant", choices=tuple(online.PLANTS), help="what is excited (default sim)")
    parser.add_argument("--out", metavar="DIR", type=Path, help="new folder of the run (default runs/<date>-demo)")
    parser.add_argument("--workbench", action="store_true", help="open the result in the workbench when it is there")
    parser.add_argument("--quick", action="store_true", help="experiments of a few seconds, and a quick diagnosis")
    parser.add_argument(
        "--lockstep",
        action=argparse.BooleanOptionalAction,
        help="the plant waits for its answers (default); without, it follows the wall clock",
    )
    return parser


def _run(options: argparse.Namespace, console: Console) -> Path:
    model = load_model(options.model)
    if options.record:
        records = read_all([Path(p) for p in options.record], options.columns)
    out = new_folder(options.out, "demo")
    begun = time.monotonic()
    if options.record:
        console.print(f"comparing {model.name} with {len(records)} record(s); results in {out}", soft_wrap=True)
        with ProgressSteps(console, _OFFLINE_S) as steps:
            analysis = offline.analyse(records, [], model, out, steps)
    else:
        files = resources.files("hydraulic_bringup.demo")
        kind = "quick" if options.quick else "full"
        experiments = [
            online.Experiment(name, Path(str(files / "plans" / f"{kind}_{name}.yaml")))
            for name in ("chirp", "multisine")
        ]
        as_built = Path(str(files / "models" / "as_built.yaml"))
        what = "a simulated actuator" + (" behind virtual CAN devices" if options.plant == "can" else "")
        console.print(f"exciting {what}, comparing it with {model.name}; results in {out}", soft_wrap=True)
        with ProgressSteps(console, 70.0 if kind == "full" else 35.0) as steps:
            bags = online.run(options.plant, as_built, experiments, out, steps, options.lockstep)
            most = 0.0 if options.lockstep else offline.MOST_MISSING[options.plant]
            records, test_records = (offline.read_bag(bag, steps, most) for bag in bags)
            analysis = offline.analyse(records, test_records, model, out, steps, options.quick)
    _print(analysis, console)
    console.print(f"\n{time.monotonic() - begun:.0f} s. Open the report: [bold]{analysis.page}[/bold]", soft_wrap=True)
    return out


def new_folder(wanted: Path | None, name: str) -> Path:
    """The folder of a run: a new one of that name, or the wanted one, which must be new or empty."""
    if wanted is None:
        return online.timestamped_folder(RUNS, name)
    if wanted.exists() and (not wanted.is_dir() or any(wanted.iterdir())):
        raise FileExistsError(f"--out {wanted}: it exists and is not empty; name a new folder")
    wanted.mkdir(parents=True, exist_ok=True)
    return wanted


def _print(analysis: offline.Analysis, console: Console) -> None:
    compared = analysis.compared
    console.print(error_table(compared, [name for name in compared["channels"] if name in SHOWN], overall=False))
    if analysis.identified is not None:
        console.print(analysis.identified["verdict"]["text"])
    if analysis.left_out:
        console.print(analysis.left_out)
    console.print(compared["verdict"]["text"])
    residual = analysis.diagnosed["residual"]
    added = residual["after_each_effect"]
    columns = (">as it is", *(f">+ {s['name']}" for s in added))
    row = [number(at["validation"]) for at in (residual["before"], *added)]
    title = "diagnosis: residual over noise on validation data (1: an exact model)"
    console.print(tables.table(title, columns, [row]))
    console.print(analysis.diagnosed["verdict"]["text"])


if __name__ == "__main__":
    sys.exit(main())
