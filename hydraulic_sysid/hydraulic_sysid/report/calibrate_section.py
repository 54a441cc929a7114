"""A calibration on the page."""

from __future__ import annotations

from typing import Any

from hydraulic_sysid.data.display import TITLES, first_upper, number, quantity

from . import calibrate_figures as figures
from .html import Figures, choice, made_on, section, table, tag, text

Result = dict[str, Any]

UNITS = {"position": "m", "pressure_a": "Pa", "pressure_b": "Pa"}


def html(result: Result, place: Figures) -> str:
    """The calibration's part of the page; its figures are given their places in ``place``."""
    return (
        _heading(result)
        + _cards(result)
        + _parameters(result, place)
        + _not_identifiable(result)
        + _residuals(result, place)
        + _correlation(result, place)
        + _method(result)
    )


def _heading(result: Result) -> str:
    kind = f"Calibration · {made_on(result)}"
    fitted = [r["name"] for r in result["records"] if r["role"] == "fit"]
    held = [r["name"] for r in result["records"] if r["role"] == "test"]
    size = len(result["parameters"])
    what = f"{size} parameter{'s' if size != 1 else ''} fitted to {', '.join(fitted)}"
    lead = f"{what}; test: {', '.join(held) or 'none'}"
    verdict = result["verdict"]
    return tag(
        "header",
        tag("div", kind, "kind") + tag("h1", text(result["model"]["name"])) + tag("p", text(lead), "lead"),
        "top",
    ) + tag("div", text(verdict["text"]), f"verdict {text(verdict['level'])}")


def _cards(result: Result) -> str:
    cards = [
        (title, _fall(result[part]), "residual over noise; 1 is an exact model")
        for part, title in (("test", "Test records"), ("fit", "Records fitted"))
        if result[part] is not None
    ]
    identifiable = [p for p in result["parameters"] if p["identifiable"]]
    at_bound = [p for p in result["parameters"] if p["at_bound"]]
    cards.append(
        (
            "Identifiable parameters",
            f"{len(identifiable)}<small> of {len(result['parameters'])}</small>",
            f"{len(at_bound) or 'none'} at a bound",
        )
    )
    state = "converged" if result["converged"] else "not converged"
    cards.append(
        ("Condition number", _power(result["condition_number"]), f"{state} after {result['iterations']} iterations")
    )
    return tag(
        "div",
        "".join(
            tag("div", tag("div", a, "name") + tag("div", b, "big") + tag("div", c, "note"), "card")
            for a, b, c in cards
        ),
        "cards",
    )


def _fall(part: dict[str, float]) -> str:
    return f"<small>{number(part['before'])} → </small>{number(part['after'])}<small> × noise</small>"


def _power(value: float | None) -> str:
    if value is None:
        return "–"
    mantissa, _, exponent = f"{value:.1e}".partition("e")
    return number(value) if value < 1e4 else f"{mantissa}·10<sup>{int(exponent)}</sup>"


def _parameters(result: Result, place: Figures) -> str:
    rows = [
        [
            text(p["key"]),
            f"{p['before']:.5g}",
            f"{p['value']:.5g}",
            _standard_error(p),
            f"{p['bounds'][0]:.3g} … {p['bounds'][1]:.3g}",
            f"at its {p['at_bound']} value" if p["at_bound"] else "",
            text("" if p["unit"] == "1" else p["unit"]),
        ]
        for p in result["parameters"]
    ]
    head = ["Parameter", "Before", "After", "Standard error", "Bounds", "At bound", "Unit"]
    lead = (
        "Standard errors take whole segments of the records as independent, so that they hold for residuals that are "
        "correlated in time. The figure gives changes relative to the value before, with 95 % intervals; an open "
        "diamond stands at a bound."
    )
    body = table(head, rows)
    return section("Parameters", lead, body + tag("div", place.place(figures.changes(result)), "gap"))


def _standard_error(parameter: dict[str, Any]) -> str:
    error = parameter["standard_error"]
    if error is None:
        return "not identifiable"
    share = 100.0 * error / (abs(parameter["value"]) or parameter["scale"])
    return f"{error:.2g} ({number(share)} %)"


def _not_identifiable(result: Result) -> str:
    vague = [p for p in result["parameters"] if not p["identifiable"]]
    items = [_vague(p) for p in vague] + [_direction(d) for d in result["not_identifiable"]]
    if not items:
        content = tag("p", "Every parameter, and every combination of them, is identifiable from these records.")
    else:
        content = tag("ul", "".join(tag("li", text(item), "above_noise") for item in items), "findings")
    lead = (
        "A parameter is not identifiable when its standard error exceeds half its size; a combination, when moving "
        "along it changes the simulation by less than the noise shows. Fix one of its parameters, or excite it."
    )
    return section("What these data cannot identify", lead, content)


def _vague(parameter: dict[str, Any]) -> str:
    error, unit = parameter["standard_error"], "" if parameter["unit"] == "1" else f" {parameter['unit']}"
    if error is None:
        return f"{parameter['key']}: these records hardly depend on it."
    return f"{parameter['key']}: {parameter['value']:.3g} ± {error:.2g}{unit} (standard error)."


def _direction(direction: dict[str, Any]) -> str:
    parts = ", ".join(f"{key} {weight:+.2f}".replace("-", "−") for key, weight in direction["weights"].items())
    word = "The combination" if len(direction["weights"]) > 1 else "The direction"
    error = direction["error"]
    size = "without limit" if error is None or error > 1e3 else f"by {100.0 * error:.0f} % of their size"
    return f"{word} {parts} (in units of the parameters' sizes) may be off {size}."


def _residuals(result: Result, place: Figures) -> str:
    parts = (("test", "test"), ("fit", "fit"))
    rows = [
        [
            text(r["record"]),
            word,
            text(first_upper(TITLES.get(r["channel"], r["channel"]))),
            quantity(r["noise_std"], UNITS[r["channel"]]),
            f"{number(r['before'])}×",
            f"{number(r['after'])}×",
        ]
        for part, word in parts
        for r in (result[part] or {"records": []})["records"]
    ]
    lead = (
        "RMS of what remains, over the measurement noise of the channel, the initial state of every segment fitted. "
        "At 1 (dotted) the noise alone is left."
    )
    head = ["Record", "Data", "Channel", "Noise (standard deviation)", "Before", "After"]
    options = [("Figure", place.place(figures.residuals(result))), ("Table", table(head, rows))]
    return section("Residual over noise", lead, choice("view", options))


def _correlation(result: Result, place: Figures) -> str:
    if len(result["parameters"]) < 2:
        return ""
    lead = (
        "Correlation of the parameters' errors. Near ±1 the data identify a combination of the two and hardly each by "
        "itself."
    )
    return section("Which parameters stand in for each other", lead, place.place(figures.correlation(result)))


def _method(result: Result) -> str:
    settings = result["settings"]
    facts = {
        "Segments": f"about {settings['segment_length']:g} s, each with its own initial state",
        "Weights": "one over the noise standard deviation of each record's channel"
        + ("; residuals beyond three times the noise count less (soft L1)" if settings["robust"] else ""),
        "Test records": "only the initial states of their segments are fitted, never a parameter",
        "Model file": result["model"]["path"] or "–",
        "Records": ", ".join(r["source"] for r in result["records"]),
    }
    listed = "".join(tag("dt", text(k)) + tag("dd", text(v)) for k, v in facts.items())
    return section("Method", "", tag("dl", listed))
