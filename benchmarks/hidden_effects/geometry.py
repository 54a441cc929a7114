"""Actuators of a family: their data sheets, and what follows from these without a simulation.

Sizes that are mild or strong on the first actuator are carried over to another by what they are made of: forces by
supply times area, flows by those of the open valve, lengths by the stroke, speeds by the top speed, masses by the
moving mass, times by the period of the oil's resonance (`DIMENSIONS`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

from . import parameters

# plant parameter → the quantities it is made of, with exponents: F force, L length, V speed, P pressure, Q flow,
# M mass, T time, C volume per pressure, D duration of a record. What is not here has no dimension or keeps its size.
DIMENSIONS: dict[str, str] = {
    "viscous": "F V-1", "viscous_difference": "F V-1", "coulomb": "F", "coulomb_difference": "F",
    "coulomb_growth": "F L-2", "stribeck_rise": "F", "stribeck_speed": "V", "bristle": "L", "bristle_time": "T",
    "load": "F", "spring": "F L-1", "second_mass": "M", "second_frequency": "T-1", "gap_mass": "M", "gap": "L",
    "gap_frequency": "T-1", "cushion": "F V-2", "cushion_length": "L", "leakage": "Q P-1",
    "leakage_turbulent": "Q P-0.5", "leakage_external": "Q P-1", "air": "P1.8", "hose": "C", "warming_time": "D",
    "spool_frequency": "T-1", "spool_rate": "T-1", "command_delay": "T", "droop": "P Q-1", "back_pressure": "P Q-2",
    "ripple": "P", "ripple_frequency": "T-1", "sensor_offset": "L", "sensor_cubic": "L-2", "sensor_lag": "T",
    "sensor_delay": "T", "sensor_play": "L", "offset_a": "P", "offset_b": "P", "seal_friction": "F P-1",
    "square_drag": "F V-2", "periodic_length": "L", "cogging": "F", "cogging_length": "L", "friction_drift_time": "D",
    "hump_friction": "F", "hump_speed": "V", "shaker": "F", "barrel_leakage": "Q P-1", "barrel_place": "L",
    "barrel_length": "L", "relief": "Q P-1", "relief_setting": "P", "null_drift_time": "D", "gain_drift_time": "D",
    "slew": "T-1", "limit_cycle": "P", "hose_creep": "C", "hose_creep_time": "T", "bulk_drift_time": "D",
    "sensor_drift": "L", "sensor_drift_time": "D", "foundation": "L F-1", "foundation_frequency": "T-1",
    "transducer_lag": "T", "position_noise": "L", "pressure_noise": "P", "sensor_step": "L", "rest_pressure": "P",
    "return_flow": "Q", "growth_length": "L", "spring_curve": "L-2", "contact_depth": "L", "reversal_speed": "V",
    "viscous_reversal_speed": "V",
}  # fmt: skip
TIMES = (0.25, 5.0)  # how far times may be stretched: valves and amplifiers do not follow the plant at will
DURATION = 0.5  # of a record of the family over one of the first bench
GRAVITY = 9.81
DIRECT = 1e4  # motor's pole over the spool's of a direct-driven valve: none


@dataclass(frozen=True)
class Geometry:
    """``sheet``: values of the data sheet that differ from `parameters.PLAIN`; ``pressures``: whether they are
    recorded; ``never``: what cannot be hidden here, and ``faint``: what cannot be if it is mild, since the usually free
    parameters take up so much of it that less than 3 % beyond the noise is left."""

    name: str
    title: str
    sheet: dict[str, float]
    pressures: bool = True
    never: tuple[str, ...] = ()
    faint: tuple[str, ...] = ()

    @cached_property
    def plain(self) -> dict[str, float]:
        return parameters.PLAIN | self.sheet

    @cached_property
    def volumes(self) -> tuple[float, float]:
        """Of both sides with the piston in the middle [m³]."""
        s = self.plain
        return s["dead_volume"] + s["area"] * s["stroke"] / 2, s["dead_volume_b"] + s["area_b"] * s["stroke"] / 2

    @cached_property
    def stiffness(self) -> float:
        """Of the oil with the valve shut, in the middle [N/m]."""
        s, (a, b) = self.plain, self.volumes
        return s["bulk_modulus"] * (s["area"] ** 2 / a + s["area_b"] ** 2 / b)

    @cached_property
    def resonance(self) -> float:
        """Of the mass on the oil [Hz]."""
        return math.sqrt(self.stiffness / self.plain["mass"]) / (2.0 * math.pi)

    @cached_property
    def speeds(self) -> tuple[float, float]:
        """Extending and retracting with the valve open, without friction [m/s] (Merritt 1967, ch. 6, unequal areas)."""
        s = self.plain
        gain = s["valve_flow"] / math.sqrt(s["valve_drop"])
        cubes = s["area"] ** 3 + s["area_b"] ** 3
        out = s["supply"] * s["area"] - s["tank"] * s["area_b"] + s["load"]
        back = s["supply"] * s["area_b"] - s["tank"] * s["area"] - s["load"]
        return gain * math.sqrt(out / cubes), gain * math.sqrt(back / cubes)

    @property
    def top_speed(self) -> float:
        """That of the slower direction [m/s]."""
        return min(self.speeds)

    @property
    def crossing(self) -> float:
        """Time over the whole stroke at top speed [s]."""
        return float(self.plain["stroke"] / self.top_speed)

    @cached_property
    def kick(self) -> float:
        """Force of the swinging mass when it is stopped dead from top speed, over supply times area."""
        s = self.plain
        return self.top_speed * math.sqrt(self.stiffness * s["mass"]) / (s["supply"] * min(s["area"], s["area_b"]))

    def scale(self, key: str) -> float:
        """How much larger the plant parameter ``key`` is here than on the first actuator, relative size alike."""
        found = 1.0
        for part in DIMENSIONS.get(key, "").split():
            found *= _ratio(part[0], self) ** float(part[1:] or 1)
        return found


def balanced(s: dict[str, float]) -> tuple[float, float]:
    """Pressures [Pa] at rest with the valve shut: the mean of supply and tank in B, balance of forces in A."""
    middle = 0.5 * (s["supply"] + s["tank"])
    return middle + (middle * (s["area_b"] - s["area"]) - s["load"]) / s["area"], middle


_QUANTITIES: dict[str, Callable[[Geometry], float]] = {
    "P": lambda g: g.plain["supply"] - g.plain["tank"],
    "F": lambda g: (g.plain["supply"] - g.plain["tank"]) * g.plain["area"],
    "Q": lambda g: g.top_speed * g.plain["area"],
    "V": lambda g: g.top_speed,
    "L": lambda g: g.plain["stroke"],
    "M": lambda g: g.plain["mass"],
    "T": lambda g: 1.0 / g.resonance,
    "C": lambda g: min(g.volumes) / g.plain["bulk_modulus"],
}


def _ratio(quantity: str, to: Geometry) -> float:
    if quantity == "D":
        return DURATION
    measure = _QUANTITIES[quantity]
    found = measure(to) / measure(GEOMETRIES["bench"])
    return min(max(found, TIMES[0]), TIMES[1]) if quantity == "T" else found


def _ring(bore: float, rod: float) -> float:
    """Annulus [m²] of a bore and a rod [mm]."""
    return math.pi / 4 * (bore**2 - rod**2) * 1e-6


def _equal(bore: float, rod: float, dead: float) -> dict[str, float]:
    return {"area": _ring(bore, rod), "area_b": _ring(bore, rod), "dead_volume": dead, "dead_volume_b": dead}


def _unequal(bore: float, rod: float, dead: float) -> dict[str, float]:
    return {"area": _ring(bore, 0.0), "area_b": _ring(bore, rod), "dead_volume": dead, "dead_volume_b": dead}


_EVERY = (
    Geometry("bench", "Double-rod actuator of 1.5 m", {}, never=("dead_volume_a",), faint=("entrained_air",)),
    Geometry("press", "Press axis with a differential cylinder 63/36 mm of 0.4 m, servo valve of 60 Hz",
             _unequal(63, 36, 2e-4) | {
                 "mass": 250.0, "stroke": 0.4, "bulk_modulus": 1.3e9, "supply": 16e6, "tank": 0.1e6,
                 "valve_flow": 6.333e-4, "viscous": 900.0, "coulomb": 350.0, "leakage": 3e-13, "bristle": 1.5e-5,
                 "spool_frequency": 60.0, "spool_damping": 0.8, "spool_motor": DIRECT, "stop_stiffness": 4e8}),
    Geometry("small", "Double-rod actuator 25/16 mm of 0.1 m that moves 5 kg, servo valve of 200 Hz",
             _equal(25, 16, 1.5e-5) | {
                 "mass": 5.0, "stroke": 0.1, "bulk_modulus": 1.4e9, "supply": 21e6, "tank": 0.5e6,
                 "valve_flow": 1.667e-4, "viscous": 60.0, "coulomb": 50.0, "leakage": 2e-13, "bristle": 8e-6,
                 "spool_frequency": 200.0, "spool_damping": 0.7, "spool_motor": DIRECT,
                 "stop_stiffness": 5e7, "stop_damping": 20.0, "position_noise": 4e-6},
             faint=("presliding", "entrained_air", "sensor_offset")),
    Geometry("long", "Double-rod actuator 160/110 mm of 3 m that moves 20 t",
             _equal(160, 110, 4e-3) | {
                 "mass": 20e3, "stroke": 3.0, "bulk_modulus": 1.35e9, "supply": 21e6, "tank": 0.4e6,
                 "valve_flow": 3.75e-3, "viscous": 6e3, "coulomb": 4e3, "leakage": 4e-12, "bristle": 3e-5,
                 "stop_stiffness": 2e9, "stop_damping": 2e4},
             never=("end_cushion", "entrained_air", "pressures_late"),
             faint=("stribeck_friction", "viscosity_drift", "valve_flow_saturation")),
    Geometry("hoist", "Differential cylinder 80/45 mm of 0.8 m, rod down, with 1.2 t hanging on it",
             _unequal(80, 45, 6e-4) | {
                 "mass": 1200.0, "stroke": 0.8, "bulk_modulus": 1.4e9, "supply": 18e6, "tank": 0.3e6,
                 "valve_flow": 1.1e-3, "viscous": 1500.0, "coulomb": 500.0, "leakage": 5e-13, "bristle": 2e-5,
                 "load": 1200.0 * GRAVITY, "stop_stiffness": 6e8, "stop_damping": 2e3},
             never=("moving_mass",), faint=("friction_asymmetry",)),
    Geometry("medium", "Double-rod actuator 50/36 mm of 0.6 m, its pressures not recorded",
             _equal(50, 36, 8e-5) | {
                 "mass": 120.0, "stroke": 0.6, "bulk_modulus": 1.5e9, "supply": 14e6, "tank": 0.2e6,
                 "valve_flow": 3e-4, "viscous": 300.0, "coulomb": 150.0, "leakage": 4e-13, "bristle": 1e-5,
                 "stop_stiffness": 2e8, "stop_damping": 200.0},
             pressures=False,
             never=("entrained_air", "sensor_offset", "pressure_offset", "supply_pressure", "dead_volume_a",
                    "transducer_lag", "pressures_late", "transducer_gain"),
             faint=("stribeck_friction", "end_cushion", "external_leakage")),
)  # fmt: skip

GEOMETRIES = {g.name: g for g in _EVERY}
