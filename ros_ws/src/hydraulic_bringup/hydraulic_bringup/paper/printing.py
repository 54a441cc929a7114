"""The study on the terminal: the paper's figures in brackets beside ours."""

from __future__ import annotations

from typing import Any

from rich import box
from rich.console import Console

from hydraulic_node_utils import tables
from hydraulic_sysid.data.display import number


def show(result: dict[str, Any], console: Console) -> None:
    """Print the tables of a study's document."""
    _models(result, console)
    _thesis(result, console)
    _grid(result, console)
    _control(result, console)
    console.print(result["verdict"]["text"])


def _models(result: dict[str, Any], console: Console) -> None:
    columns = ("excitation", "model", ">best fit, test data", ">MSE, mm²", ">FPE, mm²")
    table = tables.table("models (the paper's figures in brackets)", columns)
    for r in result["models"]:
        table.add_row(
            r["excitation"],
            r["model"],
            f"{_fit(r['best_fit'])} ({r['printed_best_fit']:.2f} %)",
            f"{r['mse_mm2']:.2g} ({r['printed_mse']:g})",
            f"{r['fpe_mm2']:.2g} ({r['printed_fpe']:g})",
        )
    console.print(table)
    _reviewed(result, console)


def _reviewed(result: dict[str, Any], console: Console) -> None:
    columns = ("work", "excitation", "model", ">best fit, second half", ">one step ahead", ">on the chirp")
    table = tables.table("the works that it reviews, on this plant (their figures in brackets)", columns)
    for r in result["reviewed"]:
        theirs = "–" if r["printed_best_fit"] is None else f"{r['printed_best_fit']:g} %"
        ours = (
            (r["why"], "", "") if r["why"] else map(_fit, (r["best_fit"], r["best_fit_one_step"], r["best_fit_chirp"]))
        )
        own, *others = ours
        table.add_row(r["authors"], r["excitation"], r["model"], f"{own} ({theirs})", *others)
    console.print(table)


def _thesis(result: dict[str, Any], console: Console) -> None:
    columns = ("excitation", ">band", ">best fit in the paper's band", ">RMSE over the grid, mm")
    table = tables.table("the thesis: excitation over the bandwidth", columns)
    for r in result["thesis"]["rows"]:
        low, high = r["band_over_bandwidth"]
        table.add_row(r["name"], f"{low:g} … {high:g}", _fit(r["best_fit_in_band"]), _mm(r["rmse"]))
    for name, why in result["not_fitted"].items():
        table.add_row(name, "", "no model", why)
    console.print(table)


def _grid(result: dict[str, Any], console: Console) -> None:
    names = [r["name"] for r in result["thesis"]["rows"]]
    title = "RMSE against the nonlinear plant, mm; in the last rows against records"
    columns = ("|signal", ">|V", ">|Hz", *(f">|{name}".replace("_", "\n") for name in names))
    table = tables.table(title, columns, box=box.SIMPLE, padding=(0, 1, 0, 0))
    for cell in result["grid"]:
        values = [_mm(cell["models"][name]["rmse"]) for name in names]
        table.add_row(cell["shape"], number(cell["amplitude"]), number(cell["frequency"]), *values)
    for row in result["recorded"]:
        values = [_mm(row["models"][name]["rmse"]) if name in row["models"] else "" for name in names]
        table.add_row(row["name"].removeprefix("validation_"), "", "rec.", *values)
    console.print(table)


def _control(result: dict[str, Any], console: Console) -> None:
    if result["control"] is None:
        return
    title = f"step of {1e3 * result['control']['step']:g} mm with NPID (the paper's figures in brackets)"
    table = tables.table(title, ("plant", ">rise time, s", ">settling time, s", ">overshoot, %"))
    for row in result["control"]["rows"]:
        figures = (
            f"{'–' if row[key] is None else format(row[key], '.3g')} ({row['printed'][key]:g})"
            for key in ("rise_time", "settling_time", "overshoot")
        )
        table.add_row(row["where"], *figures)
    console.print(table)


def _fit(value: float | None) -> str:
    return "unstable" if value is None or value != value else f"{value:.2f} %".replace("-", "−")


def _mm(value: float | None) -> str:
    return "unstable" if value is None or value != value else f"{1e3 * value:.3f}"
