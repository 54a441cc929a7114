"""Benches with something hidden: what was built, what the user of the bench knows, and its records."""

from __future__ import annotations

import gzip
import hashlib
import json
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from . import catalogue, parameters, plant
from .geometry import balanced
from .settings import FIRST, OFF, Setting

SCATTERED = ("mass", "viscous", "bulk_modulus", "valve_flow", "leakage")
SEVERITIES = ("mild", "strong")
SIZE_SCATTER = 0.15
# plant parameter of a plain bench → the effect that a user's model file has for it, unless it is hidden or 0
KNOWN = {"viscous": "viscous_friction", "coulomb": "coulomb_friction", "leakage": "internal_leakage",
         "load": "constant_load", "spool_frequency": "spool_dynamics"}  # fmt: skip
# number of the data sheet that a model file gives without bounds → its plant parameter
STATED = {"piston_area_a": "area", "piston_area_b": "area_b", "dead_volume_a": "dead_volume",
          "dead_volume_b": "dead_volume_b", "supply_pressure": "supply"}  # fmt: skip
NONE_SEEDS = 12


@dataclass(frozen=True)
class Bench:
    """One bench. kind: single, none, pair, triple, unknown, recording or datum; effects: names in `catalogue.EVERY`;
    severity: mild, strong or empty (none). Everything else follows from the seed."""

    kind: str
    effects: tuple[str, ...] = ()
    severity: str = ""
    seed: int = 0
    setting: Setting = FIRST

    @property
    def name(self) -> str:
        parts = [self.setting.name, "+".join(self.effects) or "none", self.severity, f"s{self.seed}"]
        return "-".join(p for p in parts if p)

    def rng(self, purpose: str) -> np.random.Generator:
        digest = hashlib.sha256(f"{self.name}/{purpose}".encode()).digest()
        return np.random.default_rng(int.from_bytes(digest[:8], "little"))

    @property
    def hidden(self) -> list[catalogue.Hidden]:
        return [catalogue.EVERY[name] for name in self.effects]

    def sheet(self) -> dict[str, float]:
        """What the data sheet says of the plain bench."""
        values = dict(self.setting.actuator.plain)
        for h in self.hidden:
            values |= {key: value * self.setting.scale(key) for key, value in h.sheet.items()}
        return values

    def plain(self) -> dict[str, float]:
        """The plain bench as built: the data sheet with its scatter; dry friction is on no data sheet."""
        rng = self.rng("as built")
        built = self.sheet()
        for key in SCATTERED:
            built[key] *= rng.uniform(0.95, 1.05)
        built["coulomb"] *= rng.uniform(0.85, 1.15)
        if self.setting.sized:
            built["spool_frequency"] *= rng.uniform(0.95, 1.05)
            built["load"] *= built["mass"] / self.sheet()["mass"]  # what hangs is what moves
            off = OFF if self.setting.sheet == "off" else 0.0
            wrong = {key for h in self.hidden for key in h.relative}  # by more than that
            for key in STATED.values():
                share = rng.uniform(-off, off)
                built[key] *= 1.0 if key in wrong else 1.0 + share
        return built

    def extra(self) -> dict[str, float]:
        """Plant parameters of what is hidden."""
        rng = self.rng("sizes")
        plain = parameters.NULL | self.plain()
        values: dict[str, float] = {}
        for h in self.hidden:
            for key, sizes in h.values.items():
                size = sizes[SEVERITIES.index(self.severity)]
                if h.name != "missing_codes":  # a bit has a whole number, a converter its step
                    size *= rng.uniform(1.0 - SIZE_SCATTER, 1.0 + SIZE_SCATTER)
                if key in h.signed and rng.random() < 0.5:
                    size = -size
                size *= 1.0 if key in h.relative else self.setting.scale(key)
                values[key] = plain[key] * (1.0 + size) if key in h.relative else size
                if key == "load":
                    values[key] += plain[key]
        return values

    def values(self, without: tuple[str, ...] = ()) -> dict[str, float]:
        """The plant's parameters; ``without`` names hidden effects that are left out."""
        values = self.setting.laws() | self.plain()
        extra = self.extra()
        for h in self.hidden:
            if h.name not in without:
                values |= {key: extra[key] for key in h.values}
        usual = self.setting.actuator.plain
        if values["bristle"] == usual["bristle"]:  # the bristles keep their stiffness under any friction
            values["bristle"] *= values["coulomb"] / usual["coulomb"]
        return values

    def known(self) -> list[str]:
        """Effects in the user's model file."""
        plain = self.setting.actuator.plain
        return ["end_stop", *(name for key, name in KNOWN.items() if plain[key] and name not in self.effects)]

    def truth(self) -> dict[str, dict[str, float]]:
        """Effect → parameters of the library's effect that mean the same as the plant's (empty where none do)."""
        values = self.values()
        return {h.name: {theirs: values[ours] for ours, theirs in h.truth.items()} for h in self.hidden}

    @property
    def columns(self) -> tuple[str, ...]:
        """Those of the records."""
        return plant.COLUMNS if self.setting.actuator.pressures else plant.COLUMNS[:3]

    def answer(self) -> dict[str, object]:
        subsystems = [h.subsystems for h in self.hidden]
        return {
            "name": self.name,
            "kind": self.kind,
            "severity": self.severity,
            "seed": self.seed,
            "setting": asdict(self.setting),
            "columns": list(self.columns),
            "said": [list(h.said) for h in self.hidden if h.said],
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
    """The records of a bench: experiment → columns (n,) of `Bench.columns`.

    ``without`` names hidden effects to leave out (the same bench, noise and drive otherwise); another ``draw`` is
    the same bench measured once more, with other noise and other random drives; ``names``: these experiments only.
    """
    return {name: table for name, (table, _) in runs(bench, without, noise, draw, names).items()}


def runs(
    bench: Bench, without: tuple[str, ...] = (), noise: bool = True, draw: str = "", names: tuple[str, ...] = ()
) -> dict[str, tuple[dict[str, np.ndarray], dict[str, np.ndarray]]]:
    """As `make`, each record with the truth behind it (columns of `plant.TRUTH`)."""
    values, setting, plain = bench.values(without), bench.setting, bench.plain()
    built = plain | {key: values[key] for h in bench.hidden for key in h.relative if key in plain}
    sensors = setting.instruments(bench.rng("sensors"))
    found = {}
    for name in names or setting.experiments:
        feed, gain = setting.feed(name, bench.rng(name + draw))
        rng = bench.rng(f"{name}{draw} noise") if noise else None
        start = (0.0, 0.0, *balanced(built))
        table, truth = plant.run(
            values, feed, rng, centring=gain, start=start, sensors=sensors, decimals=setting.decimals
        )
        found[name] = {c: table[c] for c in bench.columns}, truth
    return found


def model_text(bench: Bench) -> str:
    """The user's model file: the data sheet, without the hidden effects."""
    s = bench.sheet()
    known = bench.known()
    usual = bench.setting.actuator.plain

    def row(key: str, value: float, unit: str, tolerance: float = 0.0) -> str:
        lowest, middle, highest = (
            f"{v:.6g} {unit}".strip() for v in (value * (1 - tolerance), value, value * (1 + tolerance))
        )
        bounds = f", bounds: [{lowest}, {highest}]" if tolerance else ""
        return f"{key}: {{value: {middle}, source: data sheet{bounds}}}"

    lines = [
        "format: hydraulic-model-1",
        "name: bench",
        "description: Data-sheet values; the as-built values scatter by about 5 %, the bounds allow 20 %.",
        "plant: hydraulic",
        "parameters:",
        "  " + row("moving_mass", s["mass"], "kg", 0.2),
        "  " + row("piston_area_a", s["area"], "m^2"),
        "  " + row("piston_area_b", s["area_b"], "m^2"),
        "  " + row("stroke", s["stroke"], "m"),
        "  " + row("dead_volume_a", s["dead_volume"], "m^3"),
        "  " + row("dead_volume_b", s["dead_volume_b"], "m^3"),
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
        level = f"{usual['coulomb']:.6g} N"
        lines.append(
            f"  coulomb_friction: {{level: {{value: {level}, source: known to be there; size not on the data sheet}}}}"
        )
    if "internal_leakage" in known:
        lines.append(f"  internal_leakage: {{{row('coefficient', s['leakage'], 'm^3/(s*Pa)', 0.2)}}}")
    if "constant_load" in known:
        lines.append(f"  constant_load: {{{row('load', s['load'], 'N', 0.2)}}}")
    if "spool_dynamics" in known:
        frequency, damping = row("frequency", s["spool_frequency"], "Hz", 0.2), row("damping", s["spool_damping"], "")
        lines.append(f"  spool_dynamics: {{{frequency}, {damping}}}")
    return "\n".join([*lines, "history: []", ""])


def write_records(records: dict[str, dict[str, np.ndarray]], folder: Path, decimals: int = 6) -> list[Path]:
    """Write records as csv.gz into a folder, positions with so many ``decimals``; the paths."""
    folder.mkdir(parents=True, exist_ok=True)
    formats = dict(zip(plant.COLUMNS, (".3f", ".4f", f".{decimals}f", ".0f", ".0f"), strict=True))
    paths = []
    for name, table in records.items():
        columns = [[format(v, formats[c]) for v in table[c].tolist()] for c in table]
        text = "\n".join([",".join(table), *(",".join(values) for values in zip(*columns, strict=True)), ""])
        paths.append(folder / f"{name}.csv.gz")
        paths[-1].write_bytes(gzip.compress(text.encode(), compresslevel=1, mtime=0))
    return paths


def write(bench: Bench, folder: Path) -> Path:
    """Write the bench's records (csv.gz), the user's model.yaml and answer.json into ``folder``/name."""
    place = folder / bench.name
    write_records(make(bench), place, bench.setting.decimals)
    (place / "model.yaml").write_text(model_text(bench))
    (place / "answer.json").write_text(json.dumps(bench.answer(), indent=1) + "\n")
    return place


def every() -> list[Bench]:
    """The whole catalogue."""
    found = [Bench("none", seed=s) for s in range(1, NONE_SEEDS + 1)]
    for severity in SEVERITIES:
        for kind, names in catalogue.KINDS.items():
            found += [Bench(kind, (name,), severity, 1) for name in names]
    found += [Bench("pair", pair, SEVERITIES[i % 2], 1) for i, pair in enumerate(catalogue.PAIRS)]
    return found
