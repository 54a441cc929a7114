"""An identification on the page."""

from __future__ import annotations

from typing import Any

from hydraulic_sysid.data.display import first_upper, quantity

from . import identify_figures as figures
from .html import Figures, choice, made_on, section, table, tag, text

Result = dict[str, Any]
_LISTED = 15  # orders on the page; all of them stand in the JSON
_EQUATIONS = {
    "Arx": "y(t) + a₁·y(t−1) + … = b₁·u(t−nk) + … + c + e(t).",
    "TransferFunction": "(pⁿ + a₁·pⁿ⁻¹ + …)·y = (b₀·pᵐ + …)·u(t − dead time) + c with p = d/dt.",
    "StateSpace": "Coefficients of the transfer function, (zⁿ + a₁·zⁿ⁻¹ + …)·y = (b₁·zⁿ⁻¹ + …)·u.",
}


def html(result: Result, place: Figures) -> str:
    """The identification's part of the page; its figures are given their places in ``place``."""
    return _heading(result) + _cards(result) + _fit(result, place) + _orders(result) + _model(result, place)


def _heading(result: Result) -> str:
    settings = result["settings"]
    kind = f"Identification · {made_on(result)}"
    ends = f"{settings['input']['channel']} to {settings['output']['channel']}"
    title = f"{first_upper(settings['structure']['text'])} from {ends}"
    names = ", ".join(r["name"] for r in result["fit"]["records"])
    lead = f"{result['fit']['samples']} samples at {settings['sampling_time'] * 1e3:g} ms from {names}"
    verdict = result["verdict"]
    return tag("header", tag("div", kind, "kind") + tag("h1", text(title)) + tag("p", text(lead), "lead"), "top") + tag(
        "div", text(verdict["text"]), f"verdict {text(verdict['level'])}"
    )


def _cards(result: Result) -> str:
    held, square = result["test"], _square(result)
    mse = f"mse_{result['model']['minimised']}"
    words = "one step" if mse == "mse_one_step" else "free run"
    cards = (
        ("Best fit, free run", f"{_figure(held['best_fit_free_run'], '<small> %</small>')}", "on held-out data"),
        ("Best fit, one step", f"{_figure(held['best_fit_one_step'], '<small> %</small>')}", "on held-out data"),
        ("MSE", f"{_figure(held[mse], '', square[0])}<small> {square[1]}</small>", f"{words}, on held-out data"),
        ("FPE", f"{held['fpe'] * square[0]:.3g}<small> {square[1]}</small>", f"{words}, expected on fresh data"),
        ("R²", f"{_figure(_mean(held, 'r_squared_free_run'), '', 1.0, 5)}", "free run, on held-out data"),
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
    for part, word in (("test", "held out"), ("fit", "fitted")):
        for index, record in enumerate(result[part]["records"]):
            tests = place.place(figures.residual_tests(result, part, index))
            note = (
                "Correlations of the residuals; grey is where 99 % of them lie if the model left nothing unexplained. "
                "At positive lags the input came first. A free run's error is its own past's: only the input's "
                "part in it is tested."
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
            _figure(r["best_fit_one_step"], " %"), _figure(r["r_squared_free_run"], "", 1.0, 5),
            _figure(r["r_squared_one_step"], "", 1.0, 5), _figure(r["mse_free_run"], "", factor),
            _figure(r["mse_one_step"], "", factor), quantity(r["noise_std"], output), _outside(r["residual_tests"]),
        ]
        for part, word in (("test", "held out"), ("fit", "fitted"))
        for r in result[part]["records"]
    ]  # fmt: skip
    head = ["Record", "Data", "Samples", "Best fit, free run", "one step", "R², free run", "one step",
            f"MSE, free run [{unit}]", f"one step [{unit}]", "Noise of the sensor",
            "Lags outside, itself / input"]  # fmt: skip
    lead = (
        "Best fit 100·(1 − ‖y − ŷ‖/‖y − ȳ‖). Free run: on the input alone, the initial state fitted. One step: "
        "from measured outputs. Drag to zoom."
    )
    return section("Measured and identified", lead, table(head, rows) + tag("div", choice("record", options), "gap"))


def _figure(value: float | None, unit: str, factor: float = 1.0, digits: int = 3) -> str:
    """A fit in percent or an error; a dash where an unstable model has none."""
    if value is None or value != value:
        return "–"
    shown = f"{value:.2f}{unit}".replace(" ", "\u00a0") if unit else f"{value * factor:.{digits}g}"
    return shown.replace("-", "−")


def _mean(part: Result, key: str) -> float | None:
    values = [r[key] for r in part["records"]]
    return None if any(v is None or v != v for v in values) else sum(values) / len(values)


def _outside(tests: Result | None) -> str:
    """Shares of lags beyond the 99 % bounds."""
    if tests is None:
        return "–"
    return " / ".join(f"{100.0 * tests['outside'][key]:.0f} %" for key in ("autocorrelation", "cross_correlation"))


def _orders(result: Result) -> str:
    """The table of orders tried, the best by each criterion first; nothing where the order was given."""
    tried = result["orders"]
    if not tried:
        return ""
    factor, unit = _square(result)
    chosen = result["settings"]["criterion"]
    by_choice = sorted(tried, key=lambda row: (row[chosen] is None, row[chosen] or 0.0))
    listed = [row for row in by_choice if row["best_by"]] + [row for row in by_choice if not row["best_by"]]
    rows = [
        [
            text(row["text"]), str(row["parameters"]), *(_figure(row[key], "", factor) for key in ("loss", "fpe")),
            *(_figure(row[key], "", 1.0, 6) for key in ("aic", "bic")), _figure(row["cv"], "", factor),
            text(", ".join(name.upper() for name in row["best_by"])),
        ]
        for row in listed[:_LISTED]
    ]  # fmt: skip
    head = ["Structure", "Parameters", f"Loss [{unit}]", f"FPE [{unit}]", "AIC", "BIC",
            f"Cross-validation, free run [{unit}]", "Best by"]  # fmt: skip
    lead = (
        f"{len(tried)} orders were tried on the estimation data; {chosen.upper()} chose. Shown are the best by each "
        f"criterion and the next best by {chosen.upper()}."
    )
    return section("Order", lead, table(head, rows))


def _model(result: Result, place: Figures) -> str:
    model = result["model"]
    continuous = model["transfer_function"]["domain"] == "continuous"
    rows = [
        [text(c["name"]), f"{c['value']:.6g}".replace("-", "−"), _figure(c["standard_error"], "", 1.0, 2)]
        for c in model["coefficients"]
    ]
    poles = [
        [
            _complex(p),
            f"{p['natural_frequency_hz']:.3g} Hz",
            f"{p['damping']:.2f}",
            "yes" if p["stable"] else "no",
        ]
        for p in model["poles"]
    ]
    content = (
        table(["Coefficient", "Value", "Standard error"], rows)
        + tag("h3", "Poles")
        + table(["s [1/s]" if continuous else "z", "Natural frequency", "Damping", "Stable"], poles)
    )
    lead = f"{_EQUATIONS[model['type']]} The transfer function stands in linear_model.json, ready for a controller."
    return section("Model", lead, tag("div", tag("div", content) + place.place(figures.poles(result)), "two"))


def _complex(pole: Result) -> str:
    """A pole as text."""
    whole = f"{pole['real']:.5g}".replace("-", "−")
    if not pole["imaginary"]:
        return whole
    return f"{whole} {'+' if pole['imaginary'] > 0 else '−'} {abs(pole['imaginary']):.5g}i"
