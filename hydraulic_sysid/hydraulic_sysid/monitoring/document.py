"""Result documents of `monitor` and `fleet`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from hydraulic_sim.model import Model
from hydraulic_sysid.campaign import Outcome
from hydraulic_sysid.data.display import quantity
from hydraulic_sysid.data.results import heading

from .change import chart
from .estimates import Estimates, gathered
from .fleet import members
from .random_effects import pooled
from .trend import crossing, line

LIKELY = 0.5
"""Probability from which a unit is called out of family."""


def monitored(
    model: Model,
    outcomes: Sequence[Outcome],
    limits: Mapping[str, float],
    bags_per_alarm: float,
    baseline: int,
) -> dict[str, Any]:
    """Result of `monitor`: each parameter over the bags, its chart, and what has changed.

    ``limits``: key → value [SI] to forecast to. ``bags_per_alarm``: bags without change until a false alarm of any
    parameter.
    """
    series = gathered(outcomes)
    rows = [_parameter(e, model, limits.get(e.key), bags_per_alarm * len(series), baseline) for e in series]
    changed = sorted((r for r in rows if r["alarm"]), key=lambda r: (r["alarm"]["at_index"], -abs(r["alarm"]["size"])))
    rows.sort(key=lambda r: (r["alarm"] is None, r["alarm"]["at_index"] if r["alarm"] else 0))
    return {
        **heading("monitor"),
        "title": f"{model.name} over {len(outcomes)} bags",
        "model": {"name": model.name, "path": None if model.path is None else str(model.path)},
        "settings": {"bags_per_false_alarm": bags_per_alarm, "baseline": baseline},
        "time_unit": "s" if all(o.failed or o.row["start_s"] is not None for o in outcomes) else "bags",
        "bags": [
            {"name": o.labels["bag"], "state": o.state, "error": o.error.strip().rpartition("\n")[2],
             "misfit": o.row.get("misfit")}
            for o in outcomes
        ],
        "parameters": rows,
        "changed": [r["key"] for r in changed],
        "verdict": _verdict(changed, rows, len(outcomes), baseline),
    }  # fmt: skip


def _parameter(e: Estimates, model: Model, limit: float | None, run_length: float, baseline: int) -> dict[str, Any]:
    found = chart(e.values, e.errors, run_length, baseline)
    effect = e.key.rpartition(".")[0]
    row: dict[str, Any] = {
        "key": e.key,
        "unit": e.unit,
        "wear": model.library[effect].wear if effect else "",
        "bags": e.bags,
        "times": e.times,
        "values": e.values,
        "errors": e.errors,
        "chart": {"up": found.up, "down": found.down, "threshold": found.threshold},
        "limit": limit,
        "alarm": None,
        "trend": None,
        "forecast": None,
    }
    since = 0
    if found.alarm:
        since = found.alarm.onset
        before = pooled(e.values[:since], e.errors[:since])
        after = pooled(e.values[since:], e.errors[since:]) if len(e.values) - since > 1 else None
        last = after.mean if after else float(e.values[-1])
        row["alarm"] = {
            "at": e.bags[found.alarm.at],
            "onset": e.bags[since],
            "onset_index": since,
            "at_index": found.alarm.at,
            "direction": found.alarm.direction,
            "before": before.mean,
            "after": last,
            "size": (last - before.mean) / max(float(np.hypot(before.between, np.median(e.errors))), 1e-300),
        }
    trend = line(e.times[since:], e.values[since:], e.errors[since:])
    if trend:
        low, high = trend.slope_interval
        row["trend"] = {"slope": trend.slope, "interval": [low, high], "since": since,
                        "line": [trend.at(float(t))[0] for t in (e.times[since], e.times[-1])]}  # fmt: skip
        reached = crossing(trend, limit, float(e.times[-1])) if limit is not None else None
        if reached:
            row["forecast"] = {"time": reached.time, "earliest": reached.earliest, "latest": reached.latest}
    return row


def _verdict(
    changed: Sequence[Mapping[str, Any]], rows: Sequence[Mapping[str, Any]], bags: int, baseline: int
) -> dict[str, Any]:
    if not changed:
        enough = any(len(r["bags"]) > baseline for r in rows)
        text = (
            f"No change in {len(rows)} parameters over {bags} bags."
            if enough
            else f"{bags} bags are too few to test for change: the first {baseline} are the baseline."
        )
        return {"kind": "steady" if enough else "baseline", "level": "explained" if enough else "close", "text": text}
    texts = []
    for r in changed:
        alarm = r["alarm"]
        word = "grows" if alarm["direction"] > 0 else "falls"
        texts.append(
            f"{r['key']} {word} since {alarm['onset']}: {quantity(alarm['before'], r['unit'])} before, "
            f"{quantity(alarm['after'], r['unit'])} after (found at {alarm['at']})"
            + (f"; look at: {r['wear']}." if r["wear"] else ".")
        )
    if len(changed) > 1:
        texts.append("What was found later may follow from the first: diagnose the last bags.")
    return {"kind": "changed", "level": "off", "effects": [r["key"] for r in changed], "text": " ".join(texts)}


def compared(title: str, units: Mapping[str, Mapping[str, tuple[float, float]]], measures: Mapping[str, str]) -> dict:
    """Result of `fleet`: every unit beside the others in every parameter.

    ``units``: unit → parameter → (value, standard error) [SI]; ``measures``: parameter → SI unit.
    """
    rows = []
    for key, unit in measures.items():
        have = [name for name in units if key in units[name]]
        if len(have) < 4:
            continue
        values, errors = (np.array([units[name][key][i] for name in have]) for i in (0, 1))
        rows += [{"parameter": key, "measure": unit, **vars(m)} for m in members(have, values, errors)]
    rows.sort(key=lambda r: -r["probability"])
    odd = [r for r in rows if r["probability"] > LIKELY]
    text = " ".join(
        f"{r['unit']} is out of family in {r['parameter']}: {quantity(r['value'], r['measure'])}, "
        f"{abs(r['distance']):.1f} standard deviations {'above' if r['distance'] > 0 else 'below'} the others "
        f"(probability {100.0 * r['probability']:.0f} %)."
        for r in odd
    )
    return {
        **heading("fleet"),
        "title": title,
        "units": list(units),
        "rows": rows,
        "verdict": {
            "kind": "out of family" if odd else "one family",
            "level": "off" if odd else "explained",
            "units": list(dict.fromkeys(r["unit"] for r in odd)),
            "text": text or f"No unit of {len(units)} is out of family.",
        },
    }
