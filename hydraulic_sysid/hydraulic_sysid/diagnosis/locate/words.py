"""What a location says, in sentences that carry their figures."""

from __future__ import annotations

from typing import Any

from hydraulic_sysid.data.display import first_upper, number, quantity

from .blame import PARAMETERS

EXPLAINED = 1.1
"""Mean square over that of an exact model up to which nothing is left to blame."""
CLOSE = 2.0
_WORTH = 0.05  # share from which a second subsystem is named
_VIOLATED = 1.15  # RMS over noise from which a balance is called violated
_BASIC = ("force", "flow_a", "flow_b")  # of spool and supply few records know
PLACES = {
    "force": "the forces on the piston",
    "flow": "flow past the valve's lands (leakage)",
    "fluid": "the oil (compressibility, viscosity)",
    "valve": "the valve",
    "supply": "supply or return pressure",
    "sensor": "a sensor",
    PARAMETERS: "a parameter",
}
OVER = {
    "velocity": "velocity", "direction": "the direction of motion", "position": "position", "time": "time",
    "load_pressure": "the load pressure", "acceleration": "acceleration", "frequency": "frequency (a resonance)",
    "reversal": "the way since the last reversal", "opening": "the opening", "history": "what the drive was before",
    "pressure": "the pressures", "rate": "the rate of the pressures", "flow": "the flow drawn", "drive": "the drive",
}  # fmt: skip


def findings(result: dict[str, Any]) -> list[dict[str, Any]]:
    """Sentences: violated balances, the strongest first, then the subsystems that explain them."""
    found = []
    for b in sorted(result["balances"], key=lambda b: -b["ratio"]):
        size, noise = quantity(b["residual_rms"], b["unit"]), quantity(b["exact_rms"], b["unit"])
        text = f"{first_upper(b['title'])}: {size} RMS below {number(b['band'][1])} Hz"
        numbers = {"residual_rms": b["residual_rms"], "exact_rms": b["exact_rms"], "ratio": b["ratio"]}
        if b["ratio"] <= _VIOLATED:
            text += f", which is its noise ({noise})."
            found.append({"balance": b["name"], "kind": "at_noise", "text": text, "numbers": numbers})
            continue
        text += f", {number(b['ratio'])} times its noise of {noise}"
        over = b.get("explained_by", [])
        if over:
            share = 100.0 * float(over[0]["explained"])
            text += f"; {OVER.get(over[0]['variable'], over[0]['variable'])} alone explains {share:.0f} % of it"
            numbers |= {"variable": over[0]["variable"], "explained": over[0]["explained"]}
        found.append({"balance": b["name"], "kind": "violated", "text": text + ".", "numbers": numbers})
    for s in result["attribution"]:
        if s["share"] < _WORTH or _over(result) <= EXPLAINED:
            continue
        best = next(iter(s["variables"]), None)
        text = (
            f"{first_upper(PLACES[s['name']])}: {100.0 * s['share']:.0f} % of what the model lacks in its balances"
            f" ({100.0 * s['alone']:.0f} % if nothing else is blamed)"
        )
        text += f", mostly over {OVER.get(best, best)}." if best else "."
        numbers = {"share": s["share"], "alone": s["alone"]}
        found.append({"balance": None, "kind": "attribution", "subsystem": s["name"], "text": text, "numbers": numbers})
    for missing in (m for m in result["not_formed"] if m["name"] in _BASIC):
        text = f"The {missing['name'].replace('_', ' ')} balance cannot be formed: {missing['why']}."
        found.append({"balance": missing["name"], "kind": "not_formed", "text": text, "numbers": {}})
    return found


def verdict(result: dict[str, Any]) -> dict[str, str]:
    """Level and one or two sentences."""
    misfit = result["misfit"]
    if misfit is None:
        return {
            "level": "off",
            "text": "These records allow no balance: drive and position alone do not tell forces from flows. "
            "Measure the pressures of both chambers to locate a fault.",
        }
    over = _over(result)
    if over <= EXPLAINED:
        return {
            "level": "explained",
            "text": f"All balances hold to within their noise: mean square {number(over)} times an exact model's.",
        }
    blamed = [s for s in result["attribution"] if s["share"] >= _WORTH]
    level = "close" if over <= CLOSE else "off"
    text = f"The balances miss {number(over)} times the mean square that noise explains"
    if not blamed:
        return {"level": level, "text": text + "; no subsystem explains it."}
    parts = [f"{PLACES[s['name']]} ({100.0 * s['share']:.0f} %)" for s in blamed]
    text = f"{text}. It belongs to {' and '.join(parts[:3])}."
    tied = [PLACES[s["name"]] for s in result["attribution"] if s["indistinguishable"] and s is not blamed[0]]
    if tied and blamed[0]["indistinguishable"]:
        text += f" These records hardly tell that from {' or '.join(tied)}."
    return {"level": level, "text": text}


def _over(result: dict[str, Any]) -> float:
    """Mean square of the balances, parameters moved, over that of an exact model."""
    return float(result["misfit"]["refitted"] / result["misfit"]["exact_model"])
