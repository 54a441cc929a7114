"""Benches with a hidden effect: what was built, what the user of the bench knows, and its six records."""

from __future__ import annotations

import gzip
import hashlib
import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from . import catalogue, experiments, parameters, plant

SCATTERED = ("mass", "viscous", "bulk_modulus", "valve_flow", "leakage")
SEVERITIES = ("mild", "strong")
SIZE_SCATTER = 0.15
KNOWN = {"viscous": "viscous_friction", "coulomb": "coulomb_friction", "leakage": "internal_leakage"}
NONE_SEEDS = 12


@dataclass(frozen=True)
class Bench:
    """One bench. kind: single, none, pair or unknown; effects: names in `catalogue.EVERY`; severity: mild, strong
    or empty (none). Everything else follows from the seed."""

    kind: str
    effects: tuple[str, ...] = ()
    severity: str = ""
    seed: int = 0

    @property
    def name(self) -> str:
        parts = ["+".join(self.effects) or "none", self.severity, f"s{self.seed}"]
        return "-".join(p for p in parts if p)

    def rng(self, purpose: str) -> np.random.Generator:
        digest = hashlib.sha256(f"{self.name}/{purpose}".encode()).digest()
        return np.random.default_rng(int.from_bytes(digest[:8], "little"))

    @property
    def hidden(self) -> list[catalogue.Hidden]:
        return [catalogue.EVERY[name] for name in self.effects]

    def sheet(self) -> dict[str, float]:
        """What the data sheet says of the plain bench (library values of `parameters.PLAIN`)."""
        values = dict(parameters.PLAIN)
        for h in self.hidden:
            values |= h.sheet
        return values

    def plain(self) -> dict[str, float]:
        """The plain bench as built: the data sheet with its scatter; dry friction is on no data sheet."""
        rng = self.rng("as built")
        built = self.sheet()
        for key in SCATTERED:
            built[key] *= rng.uniform(0.95, 1.05)
        built["coulomb"] *= rng.uniform(0.85, 1.15)
        return built

    def extra(self) -> dict[str, float]:
        """Plant parameters of the hidden effects."""
        rng = self.rng("sizes")
        values: dict[str, float] = {}
        for h in self.hidden:
            for key, sizes in h.values.items():
                size = sizes[SEVERITIES.index(self.severity)]
                if h.name != "missing_codes":  # a bit has a whole number, a converter its step
                    size *= rng.uniform(1.0 - SIZE_SCATTER, 1.0 + SIZE_SCATTER)
                if key in h.signed and rng.random() < 0.5:
                    size = -size
                values[key] = 1.0 + size if key == "sensor_scale" else size
        return values

    def values(self, without: tuple[str, ...] = ()) -> dict[str, float]:
        """The plant's parameters; ``without`` names hidden effects that are left out."""
        values = self.plain()
        extra = self.extra()
        for h in self.hidden:
            if h.name not in without:
                values |= {key: extra[key] for key in h.values}
        if values["bristle"] == parameters.PLAIN["bristle"]:  # the bristles keep their stiffness under any friction
            values["bristle"] *= values["coulomb"] / parameters.PLAIN["coulomb"]
        return values

    def known(self) -> list[str]:
        """Effects in the user's model file."""
        return ["end_stop", *(name for name in KNOWN.values() if name not in self.effects)]

    def truth(self) -> dict[str, dict[str, float]]:
        """Effect → parameters of the library's effect that mean the same as the plant's (empty where none do)."""
        values = self.values()
        return {h.name: {theirs: values[ours] for ours, theirs in h.truth.items()} for h in self.hidden}

    def answer(self) -> dict[str, object]:
        subsystems = [h.subsystems for h in self.hidden]
        return {
            "name": self.name,
            "kind": self.kind,
            "severity": self.severity,
            "seed": self.seed,
            "hidden": self.truth(),
            "companions": sorted({c for h in self.hidden for c in h.companions}),
            "subsystem": [s[0] for s in subsystems],
            "subsystems_as_good": [list(s) for s in subsystems],
            "what": [h.what for h in self.hidden if h.what],
            "known": self.known(),
            "as_built": self.plain(),
            "plant": self.values(),
        }


def make(
    bench: Bench, *, without: tuple[str, ...] = (), noise: bool = True, draw: str = "", names: tuple[str, ...] = ()
) -> dict[str, dict[str, np.ndarray]]:
    """The six records of a bench: experiment → columns (20000,) of `plant.COLUMNS`.

    ``without`` names hidden effects to leave out (the same bench, noise and drive otherwise); another ``draw`` is
    the same bench measured once more, with other noise and other random drives; ``names``: these experiments only.
    """
    values = bench.values(without)
    records = {}
    for name in names or experiments.NAMES:
        feed = experiments.drive(name, bench.rng(name + draw))
        records[name] = plant.run(values, feed, bench.rng(f"{name}{draw} noise") if noise else None)[0]
    return records


def model_text(bench: Bench) -> str:
    """The user's model file: the data sheet, without the hidden effects."""
    s = bench.sheet()
    known = bench.known()

    def row(key: str, value: float, unit: str, tolerance: float = 0.0) -> str:
        bounds = f", bounds: [{value * (1 - tolerance):.6g} {unit}, {value * (1 + tolerance):.6g} {unit}]"
        return f"{key}: {{value: {value:.6g} {unit}, source: data sheet{bounds if tolerance else ''}}}"

    lines = [
        "format: hydraulic-model-1",
        "name: bench",
        "description: Data-sheet values; the as-built values scatter by about 5 %, the bounds allow 20 %.",
        "plant: hydraulic",
        "parameters:",
        "  " + row("moving_mass", s["mass"], "kg", 0.2),
        "  " + row("piston_area_a", s["area"], "m^2"),
        "  " + row("piston_area_b", s["area"], "m^2"),
        "  " + row("stroke", s["stroke"], "m"),
        "  " + row("dead_volume_a", s["dead_volume"], "m^3"),
        "  " + row("dead_volume_b", s["dead_volume"], "m^3"),
        "  " + row("bulk_modulus", s["bulk_modulus"], "Pa", 0.2),
        "  " + row("supply_pressure", s["supply"], "Pa"),
        "  " + row("tank_pressure", s["tank"], "Pa"),
        "  " + row("valve_flow", s["valve_flow"], "m^3/s", 0.2),
        "  " + row("valve_drop", s["valve_drop"], "Pa"),
        "effects:",
        f"  end_stop: {{{row('stiffness', s['stop_stiffness'], 'N/m')}}}",
    ]
    if "viscous_friction" in known:
        lines.append(f"  viscous_friction: {{{row('coefficient', s['viscous'], 'N*s/m', 0.2)}}}")
    if "coulomb_friction" in known:
        lines.append(
            "  coulomb_friction: {level: {value: 450 N, source: known to be there; size not on the data sheet}}"
        )
    if "internal_leakage" in known:
        lines.append(f"  internal_leakage: {{{row('coefficient', s['leakage'], 'm^3/(s*Pa)', 0.2)}}}")
    return "\n".join([*lines, "history: []", ""])


def write_records(records: dict[str, dict[str, np.ndarray]], folder: Path) -> list[Path]:
    """Write records as csv.gz into a folder; the paths."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for name, table in records.items():
        time, u, x, pa, pb = (table[c].tolist() for c in plant.COLUMNS)
        rows = [f"{a:.3f},{b:.4f},{c:.6f},{d:.0f},{e:.0f}" for a, b, c, d, e in zip(time, u, x, pa, pb, strict=True)]
        text = "\n".join([",".join(plant.COLUMNS), *rows, ""])
        paths.append(folder / f"{name}.csv.gz")
        paths[-1].write_bytes(gzip.compress(text.encode(), compresslevel=1, mtime=0))
    return paths


def write(bench: Bench, folder: Path) -> Path:
    """Write the bench's records (csv.gz), the user's model.yaml and answer.json into ``folder``/name."""
    place = folder / bench.name
    write_records(make(bench), place)
    (place / "model.yaml").write_text(model_text(bench))
    (place / "answer.json").write_text(json.dumps(bench.answer(), indent=1) + "\n")
    return place


def every() -> list[Bench]:
    """The whole catalogue."""
    found = [Bench("none", seed=s) for s in range(1, NONE_SEEDS + 1)]
    for severity in SEVERITIES:
        found += [Bench("single", (name,), severity, 1) for name in catalogue.LIBRARY]
        found += [Bench("unknown", (name,), severity, 1) for name in catalogue.UNKNOWN]
    found += [Bench("pair", pair, SEVERITIES[i % 2], 1) for i, pair in enumerate(catalogue.PAIRS)]
    return found
