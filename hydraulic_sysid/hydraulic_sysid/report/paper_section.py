"""The paper's study on the page: ours beside the printed figures."""

from __future__ import annotations

from typing import Any

from hydraulic_sysid.data.display import number, quantity, span

from . import paper_figures as figures
from .html import Figures, choice, made_on, section, table, tag, text

Result = dict[str, Any]

_BANDS = {"in": "the paper's band", "below": "below it", "above": "above it"}
_HOLDS = {True: "worse, as the thesis says", False: "not worse"}


def html(result: Result, place: Figures) -> str:
    """The study's part of the page; its figures are given their places in ``place``."""
    return (
        _heading(result)
        + _cards(result)
        + _models(result)
        + _data(result, place)
        + _thesis(result, place)
        + _grid(result, place)
        + _control(result)
        + _choices(result)
    )


def _heading(result: Result) -> str:
    verdict = result["verdict"]
    kind = tag("div", f"Nisar &amp; Munawar, reproduced · {made_on(result)}", "kind")
    lead = (
        "System Identification and Controller Design for Hydraulic Actuator: its study, on " + result["model"]["name"]
    )
    head = tag("header", kind + tag("h1", "Excitation from the bandwidth") + tag("p", text(lead), "lead"), "top")
    return head + tag("div", text(verdict["text"]), f"verdict {text(verdict['level'])}")


def _cards(result: Result) -> str:
    band = result["bandwidth"]["position"]
    cards = []
    for r in result["models"]:
        printed = f"printed {r['printed_best_fit']:.2f} %"
        cards.append((f"Best fit, {r['excitation']}", _fit(r["best_fit"], "<small> %</small>"), printed))
    measured = result["bandwidth_measured"]
    note = "closed loop, from the linearised model"
    if measured is not None:
        note += f"; the probe measures {number(measured['position'])} Hz at its amplitude"
    cards.append(("Bandwidth", f"{number(band)}<small> Hz</small>", note))
    cards.append(("Excited", f"{0.1 * band:.2g} … {2 * band:.2g}<small> Hz</small>", "0.1 … 2 times the bandwidth"))
    return tag(
        "div",
        "".join(
            tag("div", tag("div", text(a), "name") + tag("div", b, "big") + tag("div", c, "note"), "card")
            for a, b, c in cards
        ),
        "cards",
    )


def _models(result: Result) -> str:
    rows = [
        [
            text(r["excitation"]),
            text(r["model"]),
            f"{r['sampling_time'] * 1e3:g} ms",
            f"{_fit(r['best_fit'], ' %')} <small>({r['printed_best_fit']:.2f} %)</small>",
            _fit(r["best_fit_one_step"], " %"),
            f"{r['mse_mm2']:.3g} <small>({r['printed_mse']:g})</small>",
            f"{r['fpe_mm2']:.3g} <small>({r['printed_fpe']:g})</small>",
        ]
        for r in result["models"]
    ]
    rows += [
        [text(r["excitation"]), text(f"{r['model']}; {r['authors']}"), "", _printed(r["best_fit"]), "", "", ""]
        for r in result["reviewed"]
    ]
    head = ["Excitation", "Model", "Sampled every", "Best fit, free run", "one step", "MSE [mm²]", "FPE [mm²]"]
    lead = "On data the fit has not seen; in brackets what the paper prints, for its own models and those it reviews."
    return section("Models", lead, table(head, rows))


def _printed(fits: list[float]) -> str:
    return f"<small>({', '.join(f'{fit:g} %' for fit in fits)})</small>"


def _data(result: Result, place: Figures) -> str:
    options = []
    for e in result["excitations"]:
        p = e["prediction"]
        facts = (
            f"{text(e['origin']).capitalize()}. {quantity(p['drive_peak'], 'V')} at the peak, limited by "
            f"{text(p['limited_by'])}; predicted {span(p['position_min'], p['position_max'], 'm')} and "
            f"{quantity(p['velocity_peak'], 'm/s')}. Grey: held out."
        )
        content = tag("p", facts, "lead") + place.place(figures.data(e)) + place.place(figures.fit(e))
        options.append((f"{e['excitation']} · {_BANDS[e['band']]}", content))
    return section("Excitation and response", "Record, and measured against simulated.", choice("excitation", options))


def _thesis(result: Result, place: Figures) -> str:
    rows = []
    for r in result["thesis"]["rows"]:
        low, high = r["band_over_bandwidth"]
        rows.append(
            [
                text(r["excitation"]),
                f"{low:g} … {high:g}",
                _fit(r["best_fit_own"], " %"),
                _fit(r["best_fit_in_band"], " %"),
                _mm(r["rmse"]),
            ]
        )
    rows += [[text(name), "", text(why), "–", "–"] for name, why in result["not_fitted"].items()]
    head = [
        "Excitation",
        "Band over bandwidth",
        "Best fit, own held-out data",
        "in the paper's band",
        "RMSE, grid [mm]",
    ]
    said = "".join(
        tag("li", f"{text(kind)}: outside the band {_HOLDS[v['best_fit']]} by best fit, {_HOLDS[v['rmse']]} by RMSE.")
        for kind, v in result["thesis"]["holds"].items()
    )
    lead = (
        "The paper says: choose the excitation from the bandwidth, 0.1 … 2 times. The same two excitations, a decade "
        "below and above, as large as the limits allow, tried on the held-out data of the paper's band and on the "
        "grid. The ARX model keeps its 50 ms, so that the upper half of the band above lies beyond its Nyquist "
        "frequency."
    )
    content = tag("ul", said, "findings") + place.place(figures.thesis(result)) + table(head, rows)
    return section("The thesis, tried", lead, content)


def _grid(result: Result, place: Figures) -> str:
    names = [r["name"] for r in result["thesis"]["rows"]]
    rows = [
        [
            text(c["shape"]),
            number(c["amplitude"]),
            number(c["frequency"]),
            quantity(c["std"], "m"),
            *(_mm(c["models"][n]["rmse"]) for n in names),
        ]
        for c in result["grid"]
    ]
    rows += [
        [text(r["name"].replace("validation_", "recorded ")), "", "", quantity(r["std"], "m")]
        + [_mm(r["models"][n]["rmse"]) if n in r["models"] else "" for n in names]
        for r in result["recorded"]
    ]
    head = ["Signal", "V", "Hz", "Motion", *(text(n.replace("_", " ")) for n in names)]
    orders = []
    for kind, shapes in result["shapes"].items():
        printed = " < ".join(result["printed"]["rmse_order"][kind])
        orders.append(f"{kind}: {' < '.join(s['shape'] for s in shapes)} (printed: {printed})")
    lead = (
        f"Free run against the nonlinear plant, in mm. By shape, the least first: {text('; '.join(orders))}. "
        f"The smaller RMSE overall: {text(result['better'])} model (printed: {text(result['printed']['better'])})."
    )
    options = [("Figure", place.place(figures.rmse(result))), ("Every value", table(head, rows))]
    return section("RMSE over the test signals", lead, choice("rmse", options))


def _control(result: Result) -> str:
    control = result["control"]
    if control is None:
        return ""
    rows = [
        [text(r["where"]), *(f"{r[k]:.3g} <small>({r['printed'][k]:g})</small>" if r["printed"] else _or_dash(r[k])
         for k in ("rise_time", "settling_time", "overshoot"))]
        for r in control["rows"]
    ]  # fmt: skip
    head = ["Plant", "Rise time [s]", "Settling time [s]", "Overshoot [%]"]
    return section("Step with NPID", text(control["text"]), table(head, rows))


def _or_dash(value: float | None) -> str:
    return "–" if value is None else f"{value:.3g}"


def _choices(result: Result) -> str:
    items = "".join(tag("li", text(item)) for item in result["left_out"])
    return section("What the paper leaves out", "And what stands here in its place.", tag("ul", items))


def _fit(value: float | None, unit: str) -> str:
    return "unstable" if value is None else f"{value:.2f}{unit}".replace("-", "−")


def _mm(value: float | None) -> str:
    return "unstable" if value is None else f"{1e3 * value:.3f}"
