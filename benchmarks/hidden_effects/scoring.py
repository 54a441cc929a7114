"""How a diagnosis is judged: one verdict against one answer, and rates with their uncertainty over many.

Knows the schema of a diagnosis (its `verdict`, its ranked `effects`) and nothing of how it was made.
"""

from __future__ import annotations

import itertools
import math
from typing import Any

MISSING, TIE, COMPLETE, OUTSIDE = "missing", "indistinguishable", "complete", "outside the library"
DATA_SHEET, RECORDING = "data sheet", "recording"
TOGETHER = {"pair": 2, "triple": 3}  # kind of a bench → effects of the library that are hidden together
DATUM = "datum"  # kind of a bench with a wrong data sheet
SURE = 0.95  # probability of a verdict that is said to be sure
NEAR = 0.10  # of the true value, from the parameter's null
AS_GOOD = 1.2  # held-out error over that of the true structure
NULLS = {"sensor_scale.scale": 1.0}


def named(result: dict[str, Any]) -> list[str]:
    """Effects that the diagnosis says are there, the strongest first; none unless it says that some are missing."""
    if result["verdict"]["kind"] not in (MISSING, TIE):
        return []
    return [e["name"] for e in _ranked(result) if e["added"]]


def _ranked(result: dict[str, Any]) -> list[dict[str, Any]]:
    return sorted(result["effects"], key=lambda e: e["rank"])


def shortlist(result: dict[str, Any]) -> list[str]:
    """The first three names by rank, of a diagnosis that says that something is missing."""
    if result["verdict"]["kind"] not in (MISSING, TIE):
        return []
    return [e["name"] for e in _ranked(result)[:3]]


def _said(result: dict[str, Any]) -> list[str]:
    """Numbers of the data sheet and faults of the recording that the diagnosis names."""
    recording = result.get("recording", {})
    faults = [f["name"] for f in recording.get("faults", ())]
    return [d["key"] for d in result.get("data_sheet", ())] + faults + ["spikes"] * bool(recording.get("spikes"))


def _alternatives(result: dict[str, Any]) -> list[str]:
    """What a verdict says may be in the place of a number or a fault."""
    numbers = [other["key"] for d in result.get("data_sheet", ()) for other in d.get("alternatives", ())]
    faults = result.get("recording", {}).get("faults", ())
    return numbers + [other["name"] for f in faults for other in f.get("alternatives", ())]


def _tied(result: dict[str, Any]) -> list[str]:
    """Faults of the recording that are named as what may be in an effect's place."""
    return [f["name"] for f in result.get("recording", {}).get("instead", ())]


def accepted(answer: dict[str, Any]) -> tuple[str, ...]:
    """Verdicts that are right where nothing is hidden: a sheet may be found off, and spikes are a fault."""
    if not answer["setting"]["sized"]:
        return (COMPLETE,)
    return (COMPLETE, DATA_SHEET, RECORDING) if answer["setting"]["sensors"] == "spiky" else (COMPLETE, DATA_SHEET)


def judge(answer: dict[str, Any], result: dict[str, Any]) -> dict[str, Any]:
    """One bench's marks: which of the figures count for its kind, and whether each is met (see `RATES`)."""
    kind = result["verdict"]["kind"]
    true = list(answer["hidden"])
    names = named(result)
    marks: dict[str, Any] = {
        "bench": answer["name"],
        "kind": answer["kind"],
        "severity": answer["severity"],
        "true": true,
        "verdict": kind,
        "named": names,
        "said": _said(result),
        "shortlist": shortlist(result),
    }
    blind = "pressure_a_Pa" not in answer["columns"]
    if answer["kind"] == "none":
        marks["silent"] = kind in accepted(answer)
        marks["named_none"] = kind in (MISSING, TIE)
    elif answer["kind"] in (DATUM, RECORDING):
        said = marks["said"] if kind in (COMPLETE, DATA_SHEET, RECORDING) else _tied(result) if kind == TIE else []
        marks["fault_named"] = any(name in said for name in answer["said"][0])
    elif answer["kind"] == "single":
        tied = kind == TIE and blind and true[0] in result["verdict"].get("effects", ())  # these channels hold no more
        marks["right_first"] = (kind == MISSING and names[:1] == true) or tied
        marks["first_three"] = true[0] in marks["shortlist"] or tied
        marks["nothing_beside"] = set(names) <= {*true, *answer["companions"]}
    elif answer["kind"] in TOGETHER:
        shown = set(answer.get("visible", true))  # what the records do not show is not asked for
        marks[RIGHT[answer["kind"]]] = (kind in (MISSING, TIE) or not shown) and shown <= set(names)
        if shown:
            marks["one_found"] = bool(shown & set(names))
        marks["only_true"] = set(names) <= {*true, *answer["companions"]}
        marks["shown"] = sorted(shown)
    elif answer["kind"] == "unknown":
        marks["said_so"] = kind == OUTSIDE
        marks["right_subsystem"] = result["verdict"]["subsystem"] in answer["subsystems_as_good"][0]
    if answer["kind"] in ("single", *TOGETHER):
        marks["parameters"] = parameters(answer, result)
    marks["probability"] = result["verdict"].get("probability")
    # A tie is right where the truth is among what it names.
    marks["true_among"] = kind == TIE and bool(true) and set(true) <= {*names, *result["verdict"].get("effects", ())}
    if answer["kind"] in (DATUM, RECORDING) and kind in (DATA_SHEET, RECORDING):
        marks["true_among"] = any(name in _alternatives(result) for name in answer["said"][0])
    marks["verdict_right"] = bool(marks[RIGHT[answer["kind"]]]) or marks["true_among"]
    return marks


def parameters(answer: dict[str, Any], result: dict[str, Any]) -> list[dict[str, Any]]:
    """Found against true parameters of the effects that were rightly named: error relative to the distance of the
    truth from the null value, and whether the 95 % interval covers. Parameters without a finite standard error
    count as not identifiable and are left out."""
    rows = []
    names = named(result)
    for effect in result["effects"]:
        truth = answer["hidden"].get(effect["name"], {}) if effect["name"] in names else {}
        for p in effect["parameters"]:
            key = p["key"].rpartition(".")[2]
            if key not in truth or not _known(p):
                continue
            null = NULLS.get(f"{effect['name']}.{key}", 0.0)
            error = (p["value"] - truth[key]) / (truth[key] - null)
            low, high = p["interval"]
            rows.append(
                {
                    "key": f"{effect['name']}.{key}",
                    "true": truth[key],
                    "value": p["value"],
                    "relative_error": error,
                    "near": abs(error) <= NEAR,
                    "covered": low <= truth[key] <= high,
                }
            )
    return rows


def _known(p: dict[str, Any]) -> bool:
    numbers = (p.get("value"), p.get("standard_error"), *(p.get("interval") or (None,)))
    return all(isinstance(v, (int, float)) and math.isfinite(v) for v in numbers)


def wilson(hits: int, count: int, z: float = 1.96) -> tuple[float, float]:
    """95 % interval of a rate (Wilson 1927, J. Amer. Statist. Assoc. 22)."""
    if count == 0:
        return 0.0, 1.0
    rate = hits / count
    middle = (rate + z * z / (2 * count)) / (1 + z * z / count)
    half = z / (1 + z * z / count) * math.sqrt(rate * (1 - rate) / count + z * z / (4 * count * count))
    return max(middle - half, 0.0), min(middle + half, 1.0)


# kind of bench → the mark that says whether its diagnosis was right
RIGHT = {"none": "silent", "single": "right_first", "pair": "both_found", "triple": "three_found", "unknown": "said_so",
         "datum": "fault_named", "recording": "fault_named"}  # fmt: skip

SAID = (0.0, 0.5, 0.8, 0.9, 0.95, 0.99, 1.0)
"""Between which probabilities verdicts are counted together, the upper one of each included."""


def reliability(marks: list[dict[str, Any]]) -> list[tuple[float, float, int, int, float]]:
    """Of verdicts with a probability, by bins of it: its bounds, how many are right, how many there are, its mean.

    Bins without any are left out (DeGroot & Fienberg 1983, The Statistician 32).
    """
    known = [m for m in marks if m.get("probability") is not None]
    found = []
    for low, high in itertools.pairwise(SAID):
        own = [m for m in known if low < m["probability"] <= high]
        if own:
            mean = sum(m["probability"] for m in own) / len(own)
            found.append((low, high, sum(m["verdict_right"] for m in own), len(own), mean))
    return found


# figure → (title, what is wanted, mark it counts, whether it is the parameters' mark)
RATES = {
    "right_first": ("one hidden effect: right name first", "≥ 92 %"),
    "first_three": ("one hidden effect: among the first three", "≥ 98 %"),
    "nothing_beside": ("one hidden effect: nothing else named beside it", ""),
    "false_alarms": ("nothing missing: false alarms", "≤ 5 %"),
    "named_none": ("nothing missing: an effect named", "≤ 3 %"),
    "fault_named": ("wrong datum or recording: named, and no effect", "≥ 90 %"),
    "both_found": ("two hidden effects: both found", "≥ 90 %"),
    "three_found": ("three hidden effects: all found", "≥ 75 %"),
    "one_found": ("two or three hidden effects: at least one found", ""),
    "only_true": ("two or three hidden effects: none named that is not there", ""),
    "said_so": ("unknown to the library: said so", "≥ 90 %"),
    "right_subsystem": ("unknown to the library: right subsystem", "≥ 90 %"),
    "near": ("parameters of the named effect within 10 %", "where identifiable"),
    "covered": ("95 % intervals that cover the truth", "≥ 90 %"),
    "sure": ("verdicts said with 95 % or more: right", "≥ 93 %"),
    "true_among": ("ties: the truth among them", "≥ 95 %"),
    "as_good": ("held-out error ≤ 1.2 × that of the true structure refitted", "all"),
}


def rates(marks: list[dict[str, Any]]) -> dict[str, tuple[int, int]]:
    """Figure of `RATES` → hits and cases."""
    found = {}
    for name in RATES:
        if name == "false_alarms":
            cases = [not m["silent"] for m in marks if "silent" in m]
        elif name in ("near", "covered"):
            cases = [p[name] for m in marks for p in m.get("parameters", [])]
        elif name == "sure":
            cases = [m["verdict_right"] for m in marks if (m.get("probability") or 0.0) >= SURE]
        elif name == "true_among":
            cases = [m[name] for m in marks if m["verdict"] == TIE and m["true"]]
        elif name == "as_good":
            cases = [m["held_out_ratio"] <= AS_GOOD for m in marks if m.get("held_out_ratio") is not None]
        else:
            cases = [m[name] for m in marks if name in m]
        found[name] = (sum(cases), len(cases))
    return found
