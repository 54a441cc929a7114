"""A diagnosis, or an effect that was added, on the page."""

from __future__ import annotations

from typing import Any

from hydraulic_sysid.data.display import TITLES, first_upper, number, percent, quantity

from . import diagnose_figures as figures
from .html import Figures, choice, made_on, more, section, table, tag, text

Result = dict[str, Any]

_UNITS = {"position": "m", "pressure_a": "Pa", "pressure_b": "Pa"}
_FEW = 12  # effects of the ranking that are shown before the rest is folded


def html(result: Result, place: Figures) -> str:
    """The diagnosis' part of the page; its figures are given their places in ``place``."""
    return (
        _heading(result)
        + _cards(result)
        + _steps(result, place)
        + _curves(result, place)
        + _shapes(result, place)
        + _ranking(result)
        + _competing_models(result)
        + _balances(result, place)
        + _parameters(result)
        + _method(result)
    )


def _heading(result: Result) -> str:
    kind = "Diagnosis" if "competing_models" in result else "Effect added"
    records = [r["name"] for r in result["records"] if r["role"] == "fit"]
    held = [r["name"] for r in result["records"] if r["role"] == "validation"]
    lead = f"{len(records)} record{'s' if len(records) != 1 else ''}: {', '.join(records)}; validation: " + (
        ", ".join(held) or f"every {_nth(result['settings']['validation_every'])} block of each"
    )
    verdict = result["verdict"]
    return tag(
        "header",
        tag("div", f"{kind} · {made_on(result)}", "kind")
        + tag("h1", text(result["model"]["name"]))
        + tag("p", text(lead), "lead"),
        "top",
    ) + tag("div", text(verdict["text"]), f"verdict {text(verdict['level'])}")


def _nth(number_of: int | None) -> str:
    return {3: "third"}.get(number_of or 0, f"{number_of}th")


def _cards(result: Result) -> str:
    residual, verdict = result["residual"], result["verdict"]
    cards = [
        ("Verdict", text(verdict["kind"]), text(", ".join(verdict["effects"]) or "no effect was added")),
        (
            "Validation data",
            f"<small>{number(residual['before']['validation'])} → </small>{number(residual['after']['validation'])}"
            "<small> × noise</small>",
            "residual over noise; 1 is an exact model",
        ),
        ("Unexplained", percent(result["unexplained_share"]), "of what the noise did not explain before"),
    ]
    if verdict["subsystem"]:
        cards.append(("Where", text(verdict["subsystem"]), "the part of the plant that is concerned"))
    return tag(
        "div",
        "".join(
            tag("div", tag("div", a, "name") + tag("div", b, "big") + tag("div", c, "note"), "card")
            for a, b, c in cards
        ),
        "cards",
    )


def _steps(result: Result, place: Figures) -> str:
    if not result["residual"]["after_each_effect"]:
        return ""
    lead = (
        "Residual over noise on data that no fit has seen, before anything is added and after each effect, all free "
        "parameters refitted each time. At 1 (dotted) the noise alone is left."
    )
    return section("The error falls", lead, place.place(figures.steps(result)))


def _curves(result: Result, place: Figures) -> str:
    if not result["worst_segments"]:
        return ""
    options = [
        (c["record"] + (" (validation)" if c["role"] == "validation" else ""), place.place(figures.curves(c)))
        for c in result["worst_segments"]
    ]
    lead = (
        "The segment of each record on which the model was worst before, as measured and as the model has it before "
        "and after; below each, measured − model over the noise."
    )
    return section("Before and after", lead, choice("record", options))


def _shapes(result: Result, place: Figures) -> str:
    shapes = result.get("nonparametric_curves") or []
    if not shapes:
        return ""
    options = [
        (f"{first_upper(_words(s['variable']))}: {percent(s['explained_share'])}", place.place(figures.shape(s)))
        for s in shapes[:4]
    ]
    rows = [
        [text(s["summary"]), text(_words(s["variable"])), text(s["subsystem"]), percent(s["explained_share"])]
        for s in shapes
    ]
    lead = (
        "What the plant would have to be given, at which place and over which variable, to explain what no effect of "
        "the library does: linear splines fitted to the residual with their 95 % band. The share is that of the "
        "residual beyond the noise."
    )
    nearest = result.get("nearest_effects") or []
    note = tag("p", f"Nearest names of the library: {text(', '.join(nearest))}.") if nearest else ""
    every = more("All places and variables", table(["What", "Over", "Acts on", "Explains"], rows))
    return section("The shape of what is left", lead, choice("shape", options) + note + every)


def _ranking(result: Result) -> str:
    head = ["Rank", "Effect", "Acts on", "Before", "After", "Parameters (± standard error)"]
    rows = [_row(e) for e in result["effects"]]
    content = table(head, rows[:_FEW])
    if len(rows) > _FEW:
        content += more(f"{len(rows) - _FEW} more effects of the library", table(head, rows[_FEW:]))
    lead = (
        "Every effect of the library that is off: what was found first (in order), then what was refitted, then what "
        "the screen found not worth a refit (predicted error in brackets). "
        "Errors are residuals over noise on validation data."
    )
    return section("All effects", lead, content)


def _row(effect: dict[str, Any]) -> list[str]:
    name = text(effect["name"])
    after = number(effect["residual_after"])
    values = ", ".join(_value(p) for p in effect["parameters"])
    return [
        str(effect["rank"]),
        tag("strong", name) if effect["added"] else name,
        text(effect["subsystem"]),
        f"{number(effect['residual_before'])}×",
        f"{after}×" if effect["refitted"] else f"({after}×)",
        text(values),
    ]


def _value(p: dict[str, Any]) -> str:
    unit = "" if p["unit"] == "1" else f" {p['unit']}"
    error = f" ± {p['standard_error']:.2g}" if p["standard_error"] is not None else ""
    stuck = f" (at its {p['at_bound']} value)" if p["at_bound"] else ""
    return f"{p['key'].rpartition('.')[2]} {p['value']:.4g}{error}{unit}{stuck}"


def _competing_models(result: Result) -> str:
    every = result.get("competing_models") or {}
    rows = [
        [
            text(name),
            text(r["name"]),
            f"{number(r['residual_after'])}×",
            "–" if r["collinearity"] is None else f"{r['collinearity']:.3f}",
            "yes" if r["distinguishable"] else tag("strong", "no"),
        ]
        for name, others in every.items()
        for r in others
    ]
    if not rows:
        return ""
    lead = (
        "Each effect that was found, and what was tried in its place with all else refitted. Collinearity 1 means "
        "that both change the records alike beyond what free parameters can; distinguishable means that the "
        "residual decides."
    )
    head = ["Found", "In its place", "Validation residual", "Collinearity", "Distinguishable"]
    return section("Why not another", lead, table(head, rows))


def _balances(result: Result, place: Figures) -> str:
    if not result.get("balances"):
        return ""
    lead = (
        "What the measured signals must keep among each other, over the noise of each balance, for the model before "
        "and after. At 1 a balance is kept."
    )
    return section("Balances", lead, place.place(figures.balances(result)))


def _parameters(result: Result) -> str:
    rows = [
        [
            text(p["key"]),
            f"{p['value']:.5g}",
            "not identifiable" if p["standard_error"] is None else f"{p['standard_error']:.2g}",
            "" if p["interval"] is None or p["interval"][0] is None else "{:.4g} … {:.4g}".format(*p["interval"]),
            f"at its {p['at_bound']} value" if p["at_bound"] else "",
            text("" if p["unit"] == "1" else p["unit"]),
        ]
        for p in result["parameters"]
    ]
    lead = (
        "All that was fitted. Errors take segments, and whole records, as independent, and are the larger of the two: "
        "what differs from experiment to experiment because a law is not quite that of the bench is in them."
    )
    head = ["Parameter", "Value", "Standard error", "95 % interval", "At bound", "Unit"]
    return section("Parameters", lead, table(head, rows))


def _method(result: Result) -> str:
    settings = result["settings"]
    noise = "; ".join(
        f"{TITLES.get(channel, channel)} {' … '.join(_range(floors, _UNITS.get(channel, '1')))}"
        for channel, floors in result["noise_std"].items()
    )
    facts = {
        "Segments": f"about {settings['segment_length']:g} s, each with its own initial state",
        "Validation data": "the records named above"
        if settings["validation_every"] is None
        else f"every {_nth(settings['validation_every'])} block of {settings['validation_block']} segments",
        "Noise (standard deviation)": noise,
        "Model file": result["model"]["path"] or "–",
        "Records": ", ".join(r["source"] for r in result["records"]),
    }
    listed = "".join(tag("dt", text(k)) + tag("dd", text(v)) for k, v in facts.items())
    return section("Method", "", tag("dl", listed))


def _range(floors: dict[str, float], unit: str) -> list[str]:
    low, high = quantity(min(floors.values()), unit), quantity(max(floors.values()), unit)
    return [low] if low == high else [low, high]


def _words(variable: str) -> str:
    return variable.replace("_", " ")
