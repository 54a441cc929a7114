"""An identification on the page."""

from __future__ import annotations

from typing import Any

from hydraulic_sysid.display import quantity

from . import identify_figures as figures
from .html import Figures, choice, made_on, section, table, tag, text

Result = dict[str, Any]


def html(result: Result, place: Figures) -> str:
    """The identification's part of the page; its figures are given their places in ``place``."""
    return _heading(result) + _cards(result) + _fit(result, place) + _model(result, place)


def _heading(result: Result) -> str:
    settings, order = result["settings"], result["settings"]["order"]
    kind = f"Identification · {made_on(result)}"
    name = f"ARX({order['na']}, {order['nb']}, {order['nk']})"
    title = f"{name} from {settings['input']['channel']} to {settings['output']['channel']}"
    names = ", ".join(r["name"] for r in result["estimation"]["records"])
    lead = f"{result['estimation']['samples']} samples at {settings['sampling_time'] * 1e3:g} ms from {names}"
    verdict = result["verdict"]
    return tag("header", tag("div", kind, "kind") + tag("h1", text(title)) + tag("p", text(lead), "lead"), "top") + tag(
        "div", text(verdict["text"]), f"verdict {text(verdict['level'])}"
    )


def _cards(result: Result) -> str:
    held, square = result["validation"], _square(result)
    cards = (
        ("Best fit, free run", f"{_figure(held['best_fit_free_run'], '<small> %</small>')}", "on held-out data"),
        ("Best fit, one step", f"{_figure(held['best_fit_one_step'], '<small> %</small>')}", "on held-out data"),
        ("MSE", f"{held['mse_one_step'] * square[0]:.3g}<small> {square[1]}</small>", "one step, on held-out data"),
        ("FPE", f"{held['fpe'] * square[0]:.3g}<small> {square[1]}</small>", "expected on fresh data, from the fit"),
    )
    return tag(
        "div",
        "".join(
            tag("div", tag("div", a, "name") + tag("div", b, "big") + tag("div", c, "note"), "card")
            for a, b, c in cards
        ),
        "cards",
    )


def _square(result: Result) -> tuple[float, str]:
    from .style import shown

    factor, unit = shown(result["settings"]["output"]["unit"])
    return factor**2, f"({unit})²" if "/" in unit else f"{unit}²"


def _fit(result: Result, place: Figures) -> str:
    options = []
    for part, word in (("validation", "held out"), ("estimation", "fitted")):
        for index, record in enumerate(result[part]["records"]):
            tests = place.place(figures.residual_tests(result, part, index))
            note = (
                "Correlations of the one-step residual; grey is where 95 % of them lie if the model left "
                "nothing unexplained."
                if tests
                else "This stretch is too short for residual tests."
            )
            content = place.place(figures.overlay(result, part, index)) + tag("p", note, "lead") + tests
            options.append((f"{record['name']} · {word}", content))
    factor, unit = _square(result)
    output = result["settings"]["output"]["unit"]
    rows = [
        [
            text(r["name"]), word, str(r["samples"]), _figure(r["best_fit_free_run"], " %"),
            _figure(r["best_fit_one_step"], " %"), _figure(r["mse_free_run"], "", factor),
            _figure(r["mse_one_step"], "", factor), quantity(r["noise"], output),
        ]
        for part, word in (("validation", "held out"), ("estimation", "fitted"))
        for r in result[part]["records"]
    ]  # fmt: skip
    head = ["Record", "Data", "Samples", "Best fit, free run", "one step", f"MSE, free run [{unit}]",
            f"one step [{unit}]", "Noise of the sensor"]  # fmt: skip
    lead = (
        "Best fit 100·(1 − ‖y − ŷ‖/‖y − ȳ‖). Free run: on the input alone, the initial state fitted. One step: "
        "from measured outputs. Drag to zoom."
    )
    return section("Measured and identified", lead, table(head, rows) + tag("div", choice("record", options), "gap"))


def _figure(value: float | None, unit: str, factor: float = 1.0) -> str:
    """A fit in percent or an error; a dash where an unstable model has none."""
    if value is None:
        return "–"
    return f"{value:.2f}{unit}".replace("-", "−") if unit else f"{value * factor:.3g}"


def _model(result: Result, place: Figures) -> str:
    model = result["model"]
    rows = [[text(c["name"]), f"{c['value']:.6g}", f"{c['standard_error']:.2g}"] for c in model["coefficients"]]
    poles = [
        [
            f"{p['real']:.5f}"
            + (f" {'+' if p['imaginary'] > 0 else '−'} {abs(p['imaginary']):.5f}i" if p["imaginary"] else ""),
            f"{p['natural_frequency_hz']:.3g} Hz",
            f"{p['damping']:.2f}",
            "yes" if p["stable"] else "no",
        ]
        for p in model["poles"]
    ]
    content = (
        table(["Coefficient", "Value", "Standard error"], rows)
        + tag("h3", "Poles")
        + table(["z", "Natural frequency", "Damping", "Stable"], poles)
    )
    lead = (
        "y(t) + a₁·y(t−1) + … = b₁·u(t−nk) + … + c + e(t), by least squares; the transfer function stands in the JSON."
    )
    return section("Model", lead, tag("div", tag("div", content) + place.place(figures.poles(result)), "two"))
