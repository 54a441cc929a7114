"""Base physics that is always on, and its parameters.

Four-land orifice flow, q = Q_r·o·√(Δp/Δp_r) with a finite slope at zero drop (Merritt 1967, ch. 3 and 5);
compressibility of both chambers, ṗ = (q − A·v)/(V/β) (ch. 6); piston inertia; drive saturation. The end stops are
base physics too and stand in `effects/end_stop.py`. A *mechanical* plant (no hydraulics) keeps the inertia and the
friction and takes a force proportional to the drive.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from .effect import Parameter, State

MERRITT = "Merritt (1967), Hydraulic Control Systems"
DATASHEET = "data sheet of the actuator or valve"
DAHL = "Dahl (1968); Armstrong-Helouvry et al. (1994), Automatica 30(7)"

# Dry friction turns its direction within this sliding distance and with this damping time, unless a model says
# otherwise: far below what a sensor of such an axis resolves, and a true stick (no creep) at rest. Damping as in
# Canudas de Wit et al. (1995), IEEE Trans. Automatic Control 40(3).
BRISTLE_LENGTH = 5e-6
BRISTLE_TIME = 2e-3

PARAMETERS: tuple[Parameter, ...] = (
    Parameter("moving_mass", "kg", 500.0, (1e-3, 1e6), "piston, rod and rigid load", DATASHEET, required=True),
    Parameter("piston_area_a", "m^2", 1e-3, (1e-7, 10.0), "area that p_A acts on", DATASHEET,
              free=False, required=True),
    Parameter("piston_area_b", "m^2", 1e-3, (1e-7, 10.0), "area that p_B acts on", DATASHEET,
              free=False, required=True),
    Parameter("stroke", "m", 1.0, (1e-4, 100.0), "travel between the stops; position 0 is its middle", DATASHEET,
              free=False, required=True),
    Parameter("dead_volume_a", "m^3", 1e-4, (1e-9, 1.0), "oil of side A with the piston at its stop, lines included",
              DATASHEET, free=False, required=True),
    Parameter("dead_volume_b", "m^3", 1e-4, (1e-9, 1.0), "oil of side B with the piston at its stop, lines included",
              DATASHEET, free=False, required=True),
    Parameter("bulk_modulus", "Pa", 1.5e9, (1e7, 4e9), "effective bulk modulus of the oil without air",
              MERRITT + ", ch. 2"),
    Parameter("supply_pressure", "Pa", 14e6, (1e4, 1e8), "pressure at the valve's supply port", DATASHEET, free=False,
              required=True),
    Parameter("tank_pressure", "Pa", 0.0, (0.0, 1e7), "pressure at the valve's return port", DATASHEET, free=False),
    Parameter("valve_flow", "m^3/s", 1e-3, (1e-9, 1.0), "flow of one fully open land at valve_drop", DATASHEET,
              required=True),
    Parameter("valve_drop", "Pa", 3.5e6, (1e3, 1e8), "drop over one land at which valve_flow is stated", DATASHEET,
              free=False),
    Parameter("valve_leakage", "1", 0.0, (0.0, 0.1), "opening that each land keeps when shut, of full opening",
              "leakage area over valve area, " + DATASHEET, free=False),
    Parameter("drive_limit", "V", 10.0, (1e-3, 1e3), "drive at full opening; the drive saturates here", DATASHEET,
              free=False),
    Parameter("spool_travel", "m", 5e-4, (1e-6, 0.1), "spool displacement at full opening (reported, not felt)",
              DATASHEET, free=False),
    Parameter("orifice_transition", "Pa", 1e4, (100.0, 1e6), "drop below which orifice flow turns laminar",
              MERRITT + ", ch. 3", free=False, nuisance=True),
    Parameter("bristle_length", "m", BRISTLE_LENGTH, (BRISTLE_LENGTH, 5e-5),
              "sliding distance over which dry friction turns", DAHL + ": 2 to 50 um for metals", free=False,
              nuisance=True),
    Parameter("bristle_time", "s", BRISTLE_TIME, (0.0, 5e-3), "damping of the bristles over their stiffness", DAHL,
              free=False, nuisance=True),
    Parameter("drive_force", "N/V", 0.0, (-1e6, 1e6), "force per volt of a mechanical plant (without hydraulics)",
              "motor and amplifier data sheets", free=False),
)  # fmt: skip

MECHANICAL = ("moving_mass", "stroke", "drive_limit", "drive_force", "bristle_length", "bristle_time")
"""The base parameters that a mechanical plant has."""

# Rate states first, relaxation states last; effects add theirs behind each group.
STATES: tuple[State, ...] = (
    State("position", "m", scale=0.1),
    State("velocity", "m/s", scale=0.1),
    State("pressure_a", "Pa", scale=1e6),
    State("pressure_b", "Pa", scale=1e6),
    State("stick", "1", kind="relaxation"),
)


def dry_friction_rate(level: float, p: Mapping[str, float]) -> float:
    """The fastest rate [1/s] of the mass on bristles that carry a friction force [N]; ``p``: base parameters.

    A fit may try values out of bounds: their size counts.
    """
    stiffness = abs(level / (p["bristle_length"] * p["moving_mass"]))
    return max(math.sqrt(stiffness), stiffness * abs(p["bristle_time"]))


OUTPUT_UNITS = {
    "position": "m", "velocity": "m/s", "pressure_a": "Pa", "pressure_b": "Pa", "pressure_supply": "Pa", "spool": "1",
    "true_position": "m", "true_pressure_a": "Pa", "true_pressure_b": "Pa", "opening": "1",
}  # fmt: skip
OUTPUTS = tuple(OUTPUT_UNITS)
"""Columns of a simulation. position and pressures are what the sensors say, the ``true_`` ones the states."""
