"""What can be hidden in a bench: laws that stand for library effects, laws that the library does not know, faults of
the recording, and wrong numbers of the data sheet.

Each entry gives a mild value (clearly above the noise, no more) and a strong one; the seed of a bench scatters them by
±15 % and draws signs where both make sense. Effects that are known to be there in every bench (viscous and Coulomb
friction, leakage) are hidden by leaving them out of the user's model file.
"""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class Hidden:
    """One hidden effect. ``values``: plant parameter → (mild, strong); ``truth``: plant parameter → parameter of the
    library's effect that has the same meaning (compared with what a diagnosis finds); ``signed``: plant parameters
    of either sign; ``relative``: those whose sizes are shares of their plain value; ``sheet``: data-sheet values that
    differ from the plain bench (known to the user); ``companions``: names that are also right beside the effect's own;
    ``subsystems``: the first is the true one, the others are as good (oil that is soft shows in the flow balances);
    ``said``: what a diagnosis may call a fault of the recording or a wrong number, the first is the true one."""

    name: str
    subsystems: tuple[str, ...]
    values: dict[str, tuple[float, float]]
    truth: dict[str, str] = field(default_factory=dict)
    signed: tuple[str, ...] = ()
    relative: tuple[str, ...] = ()
    sheet: dict[str, float] = field(default_factory=dict)
    companions: tuple[str, ...] = ()
    said: tuple[str, ...] = ()
    what: str = ""


FORCE, FLOW, VALVE, SUPPLY, SENSOR = (("force",), ("flow",), ("valve",), ("supply",), ("sensor",))
FLUID = ("fluid", "flow")

_LIBRARY = (
    Hidden("viscous_friction", FORCE, {"viscous": (900.0, 2500.0)}, {"viscous": "coefficient"}),
    Hidden("viscous_asymmetry", FORCE, {"viscous_difference": (1000.0, 2300.0)}, {"viscous_difference": "difference"},
           signed=("viscous_difference",), sheet={"viscous": 3000.0}),
    Hidden("coulomb_friction", FORCE, {"coulomb": (200.0, 520.0), "stribeck_rise": (0.0, 250.0)},
           {"coulomb": "level"}, companions=("stribeck_friction", "presliding")),
    Hidden("stribeck_friction", FORCE, {"stribeck_rise": (180.0, 450.0), "stribeck_speed": (0.012, 0.02)},
           {"stribeck_rise": "rise", "stribeck_speed": "speed"}),
    Hidden("friction_asymmetry", FORCE, {"coulomb_difference": (200.0, 430.0)}, {"coulomb_difference": "difference"},
           signed=("coulomb_difference",), sheet={"coulomb": 600.0}),
    Hidden("position_dependent_friction", FORCE, {"coulomb_growth": (2500.0, 8000.0)}, {"coulomb_growth": "growth"}),
    Hidden("presliding", FORCE, {"bristle": (4e-4, 1.5e-3), "bristle_time": (4e-3, 6e-3)}, {"bristle": "length"}),
    Hidden("constant_load", FORCE, {"load": (350.0, 1500.0)}, {"load": "load"}, signed=("load",)),
    Hidden("load_spring", FORCE, {"spring": (1500.0, 8000.0)}, {"spring": "stiffness"}),
    Hidden("structural_flexibility", FORCE,
           {"second_mass": (60.0, 200.0), "second_frequency": (18.0, 14.0), "second_damping": (0.05, 0.05)},
           {"second_mass": "mass", "second_frequency": "frequency"}),
    Hidden("end_cushion", FORCE, {"cushion": (4e5, 1.5e6), "cushion_length": (0.5, 0.55)},
           {"cushion": "coefficient", "cushion_length": "length"}),
    Hidden("backlash", FORCE,
           {"gap_mass": (100.0, 250.0), "gap": (6e-4, 2e-3), "gap_frequency": (50.0, 50.0), "gap_damping": (0.3, 0.3)},
           {"gap_mass": "mass", "gap": "gap"}),
    Hidden("internal_leakage", FLOW, {"leakage": (4e-12, 2e-11)}, {"leakage": "coefficient"}),
    Hidden("turbulent_leakage", FLOW, {"leakage_turbulent": (6e-9, 3e-8)}, {"leakage_turbulent": "coefficient"}),
    Hidden("external_leakage", FLOW, {"leakage_external": (1e-13, 1e-12)}, {"leakage_external": "coefficient"}),
    Hidden("entrained_air", FLUID, {"air": (0.012, 0.035), "air_exponent": (1.25, 1.25)},
           {"air": "fraction"}),
    Hidden("hose_compliance", FLUID, {"hose": (8e-13, 3e-12)}, {"hose": "capacity"}),
    Hidden("viscosity_drift", FLUID + ("force",), {"warming": (-0.4, -0.65), "warming_time": (6.0, 4.0)},
           {"warming": "change", "warming_time": "time"}, sheet={"viscous": 3000.0}),
    Hidden("valve_deadband", VALVE, {"overlap": (0.01, 0.04)}, {"overlap": "width"}),
    Hidden("valve_underlap", VALVE, {"underlap": (0.01, 0.04)}, {"underlap": "width"}),
    Hidden("valve_null_bias", VALVE, {"null_bias": (0.006, 0.025)}, {"null_bias": "bias"}, signed=("null_bias",)),
    Hidden("valve_hysteresis", VALVE, {"hysteresis": (0.006, 0.02)}, {"hysteresis": "half_width"}),
    Hidden("valve_gain_asymmetry", VALVE, {"gain_asymmetry": (0.025, 0.1)}, {"gain_asymmetry": "asymmetry"},
           signed=("gain_asymmetry",)),
    Hidden("valve_gain_curve", VALVE, {"gain_progression": (0.08, 0.35)}, {"gain_progression": "progression"}),
    Hidden("valve_flow_saturation", VALVE, {"opening_limit": (0.7, 0.5)}, {"opening_limit": "limit"}),
    Hidden("spool_dynamics", VALVE, {"spool_frequency": (110.0, 40.0), "spool_damping": (0.7, 0.7)},
           {"spool_frequency": "frequency", "spool_damping": "damping"}),
    Hidden("spool_rate_limit", VALVE, {"spool_rate": (35.0, 8.0)}, {"spool_rate": "rate"}),
    Hidden("command_delay", VALVE, {"command_delay": (2.2e-3, 9e-3)}, {"command_delay": "delay"}),
    Hidden("supply_droop", SUPPLY, {"droop": (8e7, 7e8), "droop_time": (0.15, 0.15)},
           {"droop": "resistance", "droop_time": "time"}),
    Hidden("return_back_pressure", SUPPLY, {"back_pressure": (3e10, 2.5e11)}, {"back_pressure": "resistance"}),
    Hidden("pump_ripple", SUPPLY, {"ripple": (3e5, 8e5), "ripple_frequency": (24.0, 37.0), "ripple_phase": (1.0, 2.0)},
           {"ripple": "amplitude", "ripple_frequency": "frequency"}),
    Hidden("sensor_offset", SENSOR, {"sensor_offset": (0.06, 0.15)}, {"sensor_offset": "offset"},
           signed=("sensor_offset",)),
    Hidden("sensor_scale", SENSOR, {"sensor_scale": (0.03, 0.08)}, {"sensor_scale": "scale"}, signed=("sensor_scale",),
           relative=("sensor_scale",)),
    Hidden("sensor_nonlinearity", SENSOR, {"sensor_cubic": (0.08, 0.3)}, {"sensor_cubic": "cubic"},
           signed=("sensor_cubic",)),
    Hidden("sensor_lag", SENSOR, {"sensor_lag": (2.2e-3, 9e-3)}, {"sensor_lag": "time"}),
    Hidden("sensor_delay", SENSOR, {"sensor_delay": (2.2e-3, 8e-3)}, {"sensor_delay": "delay"}),
    Hidden("sensor_backlash", SENSOR, {"sensor_play": (1.2e-4, 5e-4)}, {"sensor_play": "half_gap"}),
    Hidden("sensor_quantisation", SENSOR, {"sensor_step": (3e-4, 1e-3)}, {"sensor_step": "step"}),
    Hidden("pressure_offset", SENSOR, {"offset_a": (6e4, 2e5), "offset_b": (4e4, 1.2e5)},
           {"offset_a": "offset_a", "offset_b": "offset_b"}, signed=("offset_a", "offset_b")),
)  # fmt: skip

_UNKNOWN = (
    Hidden("seal_pressure_friction", FORCE, {"seal_friction": (4e-4, 1.2e-3)}, what="seals press harder at pressure"),
    Hidden("load_dependent_friction", FORCE, {"load_friction": (0.12, 0.3)}, what="friction grows with the load"),
    Hidden("square_law_drag", FORCE, {"square_drag": (5e3, 2e4)}, what="hydrodynamic drag, v|v|"),
    Hidden("periodic_friction", FORCE, {"periodic_friction": (0.6, 0.9), "periodic_length": (0.03, 0.03)},
           what="friction periodic over the stroke"),
    Hidden("magnetic_cogging", FORCE, {"cogging": (400.0, 900.0), "cogging_length": (0.03, 0.03)},
           what="force periodic over the stroke"),
    Hidden("friction_drift", FORCE, {"friction_drift": (-0.5, 1.2), "friction_drift_time": (6.0, 6.0)},
           what="dry friction that changes as the seals warm"),
    Hidden("hump_friction", FORCE, {"hump_friction": (350.0, 900.0), "hump_speed": (0.05, 0.05)},
           what="friction falls with speed beyond a maximum"),
    Hidden("outside_shaker", FORCE, {"shaker": (800.0, 1600.0), "shaker_frequency": (1.7, 1.7)},
           what="a force from a neighbouring machine"),
    Hidden("worn_barrel_leakage", FLOW, {"barrel_leakage": (3e-11, 1.5e-10), "barrel_length": (0.04, 0.05)},
           what="cross-port leakage at one place of the stroke"),
    Hidden("crossport_relief", FLOW, {"relief": (1e-10, 4e-10), "relief_setting": (1e6, 8e5)},
           what="relief between the ports opens beyond a load pressure"),
    Hidden("hose_creep", FLUID, {"hose_creep": (1.5e-12, 5e-12), "hose_creep_time": (0.03, 0.04)},
           what="hose wall that gives way late"),
    Hidden("bulk_modulus_drift", FLUID, {"bulk_drift": (-0.15, -0.4), "bulk_drift_time": (6.0, 6.0)},
           what="oil that softens as it warms"),
    Hidden("valve_gain_ripple", VALVE, {"gain_ripple": (0.08, 0.25)}, what="flow gain ripples over the opening"),
    Hidden("valve_null_drift", VALVE, {"null_drift": (0.01, 0.03), "null_drift_time": (7.0, 7.0)},
           signed=("null_drift",), what="null that drifts as the valve warms"),
    Hidden("valve_gain_drift", VALVE, {"gain_drift": (-0.06, -0.2), "gain_drift_time": (7.0, 7.0)},
           what="flow gain that drifts as the valve warms"),
    Hidden("spool_jet_force", VALVE, {"jet_force": (0.12, 0.35)}, what="flow force closes the spool under valve drop"),
    Hidden("slew_asymmetry", VALVE, {"slew": (30.0, 12.0), "slew_asymmetry": (0.6, 0.7)},
           what="spool closes more slowly than it opens"),
    Hidden("supply_limit_cycle", SUPPLY, {"limit_cycle": (4e5, 1.5e6), "limit_cycle_frequency": (0.8, 0.8)},
           what="relaxation oscillation of the pump's regulator"),
    Hidden("sensor_thermal_drift", SENSOR, {"sensor_drift": (4e-3, 1.2e-2), "sensor_drift_time": (7.0, 7.0)},
           signed=("sensor_drift",), what="position reading that drifts as the sensor warms"),
    Hidden("missing_codes", SENSOR, {"missing_codes": (4.0, 6.0), "sensor_step": (2.4e-5, 2.4e-5)},
           what="a converter bit that is stuck"),
    Hidden("foundation_resonance", SENSOR, {"foundation": (4e-8, 1.5e-7), "foundation_frequency": (7.0, 7.0)},
           what="the floor that carries the sensor resonates"),
)  # fmt: skip

_RECORDING = (
    Hidden("transducer_lag", SENSOR, {"transducer_lag": (2e-3, 1e-2)}, said=("pressures_low_pass",),
           what="slow pressure transducers"),
    Hidden("pressures_late", SENSOR, {"pressures_late": (1.5, 2.6)}, said=("pressures",),
           what="pressures that the logger has late"),
    Hidden("drive_late", SENSOR, {"drive_late": (1.2, 1.9)}, said=("drive", "position"),
           what="a drive that the logger has late"),
    Hidden("transducer_gain", SENSOR, {"transducer_gain": (0.02, 0.05)}, signed=("transducer_gain",),
           said=("pressure_a_gain",), what="gain error of one pressure transducer"),
    Hidden("spikes", SENSOR, {"spike_share": (2e-3, 5e-3)}, said=("spikes",), what="a loose contact"),
)  # fmt: skip

_DATUM = (
    Hidden("supply_pressure", SUPPLY, {"supply": (0.026, 0.043)}, {"supply": "supply_pressure"}, signed=("supply",),
           relative=("supply",), said=("supply_pressure",)),
    # With forces and flows free to scale, the records hold the ratio of the areas alone.
    Hidden("piston_area_b", FORCE, {"area_b": (0.024, 0.035)}, {"area_b": "piston_area_b"}, signed=("area_b",),
           relative=("area_b",), said=("piston_area_b", "piston_area_a")),
    Hidden("moving_mass", FORCE, {"mass": (0.5, 0.9)}, {"mass": "moving_mass"}, relative=("mass",),
           said=("moving_mass",), what="a payload that the data sheet does not know"),
    Hidden("dead_volume_a", FLUID, {"dead_volume": (0.4, 0.5)}, {"dead_volume": "dead_volume_a"},
           signed=("dead_volume",), relative=("dead_volume",), said=("dead_volume_a",)),
)  # fmt: skip

LIBRARY = {h.name: h for h in _LIBRARY}
UNKNOWN = {h.name: h for h in _UNKNOWN}
RECORDING = {h.name: h for h in _RECORDING}
DATUM = {h.name: h for h in _DATUM}
EVERY = LIBRARY | UNKNOWN | RECORDING | DATUM
KINDS = {"single": LIBRARY, "unknown": UNKNOWN, "recording": RECORDING, "datum": DATUM}

PAIRS: tuple[tuple[str, str], ...] = (
    ("entrained_air", "command_delay"),
    ("coulomb_friction", "valve_deadband"),
    ("stribeck_friction", "valve_null_bias"),
    ("valve_deadband", "internal_leakage"),
    ("valve_hysteresis", "constant_load"),
    ("supply_droop", "valve_gain_asymmetry"),
    ("spool_dynamics", "structural_flexibility"),
    ("sensor_lag", "entrained_air"),
    ("sensor_scale", "valve_null_bias"),
    ("load_spring", "internal_leakage"),
    ("valve_underlap", "viscous_friction"),
    ("return_back_pressure", "friction_asymmetry"),
    ("external_leakage", "valve_deadband"),
    ("hose_compliance", "spool_rate_limit"),
    ("pressure_offset", "valve_null_bias"),
    ("backlash", "command_delay"),
    ("sensor_delay", "coulomb_friction"),
    ("valve_gain_curve", "supply_droop"),
    ("valve_flow_saturation", "position_dependent_friction"),
    ("turbulent_leakage", "constant_load"),
    ("sensor_backlash", "valve_gain_asymmetry"),
    ("pump_ripple", "stribeck_friction"),
    ("sensor_nonlinearity", "load_spring"),
    ("spool_dynamics", "supply_droop"),
)
