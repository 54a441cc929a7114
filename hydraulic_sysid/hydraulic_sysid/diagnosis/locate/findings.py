"""What the balances say, in sentences that carry their figures."""

from __future__ import annotations

from typing import Any

from hydraulic_sysid.data.display import first_upper, number, quantity

from .attribution import PARAMETERS

EXPLAINED = 1.1
"""Mean square over that of an exact model up to which nothing is left to attribute."""
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
VARIABLES = {
    "velocity": "velocity", "direction": "the direction of motion", "position": "position", "time": "time",
    "load_pressure": "the load pressure", "acceleration": "acceleration", "frequency": "frequency (a resonance)",
    "reversal": "travel since the last reversal", "opening": "the opening", "history": "the drive's past",
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
        if b.get("explained_by"):
            best, explained = b["explained_by"][0]["variable"], b["explained_by"][0]["explained"]
            text += f"; {VARIABLES.get(best, best)} alone explains {100.0 * explained:.0f} % of it"
            numbers |= {"variable": best, "explained": explained}
        found.append({"balance": b["name"], "kind": "violated", "text": text + ".", "numbers": numbers})
    for s in result["attribution"]:
        if s["share"] < _WORTH or _ratio(result) <= EXPLAINED:
            continue
        best = next(iter(s["variables"]), None)
        text = (
            f"{first_upper(PLACES[s['name']])}: {100.0 * s['share']:.0f} % of what the model lacks in its balances"
            f" ({100.0 * s['alone']:.0f} % alone)"
        )
        text += f", mostly as a function of {VARIABLES.get(best, best)}." if best else "."
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
            "text": "These records allow no balance: drive and position alone cannot distinguish forces from flows. "
            "Measure the pressures of both chambers to locate a fault.",
        }
    ratio = _ratio(result)
    if ratio <= EXPLAINED:
        return {
            "level": "explained",
            "text": f"All balances hold to within their noise: mean square {number(ratio)} times an exact model's.",
        }
    responsible = [s for s in result["attribution"] if s["share"] >= _WORTH]
    level = "close" if ratio <= CLOSE else "off"
    text = f"The mean square of the balances is {number(ratio)} times what noise explains"
    if not responsible:
        return {"level": level, "text": text + "; no subsystem explains it."}
    parts = [f"{PLACES[s['name']]} ({100.0 * s['share']:.0f} %)" for s in responsible]
    text = f"{text}. Responsible: {' and '.join(parts[:3])}."
    alike = [PLACES[s["name"]] for s in result["attribution"] if s["indistinguishable"] and s is not responsible[0]]
    if alike and responsible[0]["indistinguishable"]:
        text += f" These records hardly distinguish that from {' or '.join(alike)}."
    return {"level": level, "text": text}


def _ratio(result: dict[str, Any]) -> float:
    """Mean square of the balances, parameters moved, over that of an exact model."""
    return float(result["misfit"]["refitted"] / result["misfit"]["exact_model"])
