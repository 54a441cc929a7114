"""What the independent plant can be told: one record of numbers, each with the value at which it does nothing.

SI units throughout. The first block is the plain bench of the data sheet; the second block holds laws that stand for
effects of the library under test; the third holds effects that the library does not know; the fourth holds sensors
and logger; the last holds the sizes at which laws bend. Nothing here is imported from the project: the plant is a
judge, so it must not share code, solver or laws with what it judges.
"""

from __future__ import annotations

import numpy as np

PLAIN: dict[str, float] = {
    "mass": 500.0,
    "area": 8.0645e-3,
    "area_b": 8.0645e-3,
    "stroke": 1.524,
    "dead_volume": 3.048e-4,
    "dead_volume_b": 3.048e-4,
    "bulk_modulus": 1.5168e9,
    "supply": 14.0e6,
    "tank": 0.3e6,
    "valve_flow": 2.5e-3,
    "valve_drop": 3.5e6,
    "drive_limit": 10.0,
    "viscous": 164.0,
    "leakage": 5e-13,
    "coulomb": 450.0,  # not on the data sheet
    "bristle": 2.25e-5,  # sliding distance over which the bristles bend, m: 450 N over 2e7 N/m
    "bristle_time": 1e-4,  # their damping over their stiffness, s
    "load": 0.0,
    "spool_frequency": 0.0,  # 0: ideal
    "spool_damping": 0.7,
    "spool_motor": 12.0,  # the torque motor's pole over the spool's
    "stop_stiffness": 6.14e8,
    "stop_damping": 200.0,
}

LIBRARY_LAWS: dict[str, float] = {
    "viscous_difference": 0.0,
    "stribeck_rise": 0.0,
    "stribeck_speed": 0.01,
    "coulomb_difference": 0.0,
    "coulomb_growth": 0.0,
    "spring": 0.0,
    "second_mass": 0.0,
    "second_frequency": 20.0,
    "second_damping": 0.05,
    "gap_mass": 0.0,
    "gap": 0.0,
    "gap_frequency": 50.0,
    "gap_damping": 0.1,
    "cushion": 0.0,
    "cushion_length": 0.08,
    "leakage_turbulent": 0.0,
    "leakage_external": 0.0,
    "air": 0.0,
    "air_exponent": 1.25,
    "hose": 0.0,
    "warming": 0.0,
    "warming_time": 6.0,
    "overlap": 0.0,
    "underlap": 0.0,
    "null_bias": 0.0,
    "hysteresis": 0.0,
    "gain_asymmetry": 0.0,
    "gain_progression": 0.0,
    "opening_limit": 0.0,  # 0: none
    "spool_rate": 0.0,  # 0: unlimited
    "command_delay": 0.0,
    "droop": 0.0,
    "droop_time": 0.1,
    "back_pressure": 0.0,
    "back_pressure_time": 5e-3,
    "ripple": 0.0,
    "ripple_frequency": 30.0,
    "ripple_phase": 0.0,
    "sensor_offset": 0.0,
    "sensor_scale": 1.0,
    "sensor_cubic": 0.0,
    "sensor_lag": 0.0,
    "sensor_delay": 0.0,
    "sensor_play": 0.0,
    "offset_a": 0.0,
    "offset_b": 0.0,
}

UNKNOWN_LAWS: dict[str, float] = {
    "seal_friction": 0.0,  # friction per mean chamber pressure above rest, N/Pa
    "load_friction": 0.0,  # friction per |load force|, 1
    "square_drag": 0.0,  # N/(m/s)^2
    "periodic_friction": 0.0,  # relative amplitude of the friction level over x
    "periodic_length": 0.02,
    "cogging": 0.0,  # N
    "cogging_length": 0.03,
    "friction_drift": 0.0,  # relative change of dry friction in the long run
    "friction_drift_time": 6.0,
    "hump_friction": 0.0,  # N, friction with a maximum at a middle speed, negative slope beyond
    "hump_speed": 0.05,
    "shaker": 0.0,  # N, a force from outside
    "shaker_frequency": 1.7,
    "barrel_leakage": 0.0,  # m^3/(s Pa), leakage at a worn place
    "barrel_place": 0.05,
    "barrel_length": 0.04,
    "relief": 0.0,  # m^3/(s Pa) beyond the cross-port relief's setting
    "relief_setting": 1e6,
    "gain_ripple": 0.0,  # relative ripple of the flow over the opening
    "gain_ripple_length": 0.08,
    "null_drift": 0.0,  # of full opening, in the long run
    "null_drift_time": 7.0,
    "gain_drift": 0.0,  # relative, in the long run
    "gain_drift_time": 7.0,
    "jet_force": 0.0,  # loss of opening per opening and relative valve drop
    "slew_asymmetry": 0.0,  # 1: closing is that much slower; needs slew
    "slew": 0.0,  # full openings per second, opening
    "limit_cycle": 0.0,  # Pa, amplitude of a supply regulator's relaxation oscillation
    "limit_cycle_frequency": 0.8,
    "hose_creep": 0.0,  # m^3/Pa, hose wall that gives way late
    "hose_creep_time": 0.03,
    "bulk_drift": 0.0,  # relative change of the bulk modulus in the long run
    "bulk_drift_time": 6.0,
    "sensor_drift": 0.0,  # m, in the long run
    "sensor_drift_time": 7.0,
    "missing_codes": 0.0,  # converter bit that is stuck at 0 (its number; 0: none)
    "foundation": 0.0,  # m/N, compliance of the floor that carries the sensor
    "foundation_frequency": 7.0,
    "transducer_gain": 0.0,  # relative gain error of transducer A
    "transducer_lag": 0.0,  # s
}

RECORDING: dict[str, float] = {
    "position_noise": 20e-6,  # m, before the converter
    "pressure_noise": 15e3,  # Pa
    "sensor_step": 2.4e-5,
    "pressures_late": 0.0,  # samples
    "drive_late": 0.0,  # samples
    "spike_share": 0.0,  # of the samples of one channel
    "spike_channel": 1.0,  # 0: position, 1: pressure A
    "spike_size": 100.0,  # over the noise
}

BENDS: dict[str, float] = {
    "rest_pressure": 7.15e6,  # Pa: mean chamber pressure at rest
    "return_flow": 2e-3,  # m^3/s, where the back pressure turns from laminar to rough
    "growth_length": 0.8,  # m, of a friction that grows as a hyperbolic cosine
    "spring_curve": 0.05,  # 1/m^2
    "contact_depth": 1e-4,  # m, where a Hertzian contact is as stiff as a linear one
    "reversal_speed": 2e-4,  # m/s, over which dry friction that differs by direction turns
    "viscous_reversal_speed": 5e-3,
}

NULL: dict[str, float] = PLAIN | LIBRARY_LAWS | UNKNOWN_LAWS | RECORDING | BENDS
DTYPE = np.dtype([(name, np.float64) for name in NULL])


def record(values: dict[str, float]) -> np.void:
    """The parameters as one record; those not given keep their null value. KeyError names a stranger."""
    strangers = set(values) - set(NULL)
    if strangers:
        raise KeyError(f"unknown plant parameters {sorted(strangers)}")
    return np.array([tuple((NULL | values).values())], dtype=DTYPE)[0]
