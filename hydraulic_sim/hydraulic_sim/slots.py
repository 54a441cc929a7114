"""Where effects act: the stages of the plant, in the order in which they are evaluated.

Per sample (the drive is held over a sample): *command* turns the drive into the demanded opening; *position
sensor* and *pressure sensor* turn states into readings. Within the right-hand side: viscosity → loop → spool →
opening → lands → supply → flow → compliance → force; in a mechanical plant viscosity → loop → spool → motor → force.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Slot:
    """One stage.

    ``kind``: "law" (one effect at a time, with an ideal default), "chain" (each effect takes the stage's signal and
    returns it changed) or "sum" (contributions add). ``returns`` names what a kernel returns. ``subsystem`` is the part
    of the bench it belongs to. ``hydraulic`` marks a stage that a mechanical plant does not have, ``mechanical`` one
    that only such a plant has.
    """

    name: str
    kind: str
    returns: tuple[str, ...]
    subsystem: str
    what: str
    per_sample: bool = False
    hydraulic: bool = False
    mechanical: bool = False


SLOTS: dict[str, Slot] = {
    s.name: s
    for s in (
        Slot("command", "chain", ("command",), "valve", "drive to demanded opening, −1…1", per_sample=True),
        Slot("viscosity", "chain", ("viscosity",), "fluid", "factor on all viscous terms"),
        Slot("loop", "law", ("demand",), "valve",
             "command and motion to the demanded opening; ideal: the command is the demand (no controller inside)"),
        Slot("spool", "law", ("spool",), "valve", "demanded opening to spool position; ideal: equal"),
        Slot("opening", "chain", ("opening",), "valve", "spool position to effective opening", hydraulic=True),
        Slot("lands", "law", ("land_pa", "land_at", "land_pb", "land_bt"), "valve",
             "opening to the four lands' relative openings; ideal: critical centre", hydraulic=True),
        Slot("supply", "law", ("pressure_supply",), "supply", "pump pressure; ideal: constant", hydraulic=True),
        Slot("ripple", "sum", ("pressure_supply",), "supply", "what adds to the supply pressure", hydraulic=True),
        Slot("tank", "law", ("pressure_tank",), "supply", "return pressure; ideal: constant", hydraulic=True),
        Slot("flow", "sum", ("flow_a", "flow_b"), "flow", "flow into chamber A and into chamber B besides the lands",
             hydraulic=True),
        Slot("compliance", "sum", ("compliance_a", "compliance_b"), "fluid",
             "capacity [m³/Pa] of the chambers beside that of the plain oil", hydraulic=True),
        Slot("motor", "chain", ("effort",), "valve", "demand to the share of the motor's full force", mechanical=True),
        Slot("inertia", "sum", ("mass",), "force", "mass that moves with the piston besides moving_mass"),
        Slot("bristle", "law", ("bristle_length", "bristle_time"), "force",
             "how the direction of dry friction follows the motion; ideal: within microns"),
        Slot("force", "sum", ("force",), "force", "force on the piston besides the pressures"),
        Slot("position_sensor", "chain", ("reading",), "sensor", "true position to reading", per_sample=True),
        Slot("pressure_sensor", "chain", ("reading_a", "reading_b"), "sensor", "pressures to readings",
             per_sample=True, hydraulic=True),
    )
}  # fmt: skip

# What a kernel may ask for by name, and from which stage on it is known (the slot's place in SLOTS).
_ORDER = {name: i for i, name in enumerate(SLOTS)}
SIGNALS: dict[str, tuple[int, str]] = {
    "t": (0, "time since the start [s]"),
    "position": (0, "piston position, 0 in mid stroke [m]"),
    "velocity": (0, "piston velocity [m/s]"),
    "pressure_a": (0, "pressure in chamber A [Pa]"),
    "pressure_b": (0, "pressure in chamber B [Pa]"),
    "pressure_difference": (0, "p_A − p_B [Pa]"),
    "load_pressure": (0, "p_A − p_B·A_B/A_A, the force of the pressures over area A [Pa]"),
    "viscosity": (_ORDER["spool"], "factor on viscous terms, 1 at the start [-]"),
    "command": (0, "demanded opening, −1…1, behind the loop where one is closed [-]"),
    "spool": (_ORDER["opening"], "spool position, −1…1 [-]"),
    "opening": (_ORDER["opening"], "effective opening [-]"),
    "pressure_supply": (_ORDER["ripple"], "supply pressure at the valve [Pa]"),
    "pressure_tank": (_ORDER["flow"], "return pressure at the valve [Pa]"),
    "flow_supply": (_ORDER["flow"], "flow drawn from the supply [m³/s]"),
    "flow_tank": (_ORDER["flow"], "flow returned to the tank [m³/s]"),
    "volume_a": (_ORDER["compliance"], "oil volume of chamber A [m³]"),
    "volume_b": (_ORDER["compliance"], "oil volume of chamber B [m³]"),
    "actuator_force": (_ORDER["inertia"], "force of the pressures or of the motor [N]"),
    "acceleration": (len(SLOTS), "piston acceleration [m/s²]"),
    "direction": (_ORDER["force"], "direction of dry friction, −1…1 [-]"),
}
STATE_SIGNALS = ("t", "position", "velocity", "pressure_a", "pressure_b", "pressure_difference", "load_pressure")
PER_SAMPLE = ("memory", "dt")
OF_COMMAND = ("interval", "into")
"""What else an effect on the command may ask for."""


def known_at(slot: str, signal: str) -> bool:
    """Whether ``signal`` is already computed where ``slot`` is evaluated (dynamics run last: slot "dynamics")."""
    if signal not in SIGNALS:
        return False
    if slot != "dynamics" and SLOTS[slot].per_sample:
        return signal in STATE_SIGNALS
    return slot == "dynamics" or SIGNALS[signal][0] <= _ORDER[slot]
