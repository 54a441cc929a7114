"""Entrained air: bubbles make the oil soft at low pressure.

    1/β_e = [(1−α)·e^(−(p−p0)/β)/β + α·(p0/p)^(1/n)/(n·p)] / [(1−α)·e^(−(p−p0)/β) + α·(p0/p)^(1/n)]

α: air by volume at atmospheric pressure p0; n: polytropic exponent. Stated as capacity V·(1/β_e − 1/β) beside that
of the plain oil. Pressures count from vacuum and are taken as at least a tenth of p0.

Source: Nykänen, Esqué & Ellman (2000), Comparison of different fluid models, PTMC; Merritt (1967),
Hydraulic Control Systems, ch. 2.
"""

import math

from numba import njit

from hydraulic_sim.effect import Effect, Parameter

P0 = 101325.0  # Pa, atmosphere


@njit(error_model="numpy")
def excess(pressure, bulk_modulus, fraction, exponent):
    """1/β_e − 1/β [1/Pa] at a pressure [Pa]."""
    p = max(pressure, 0.1 * P0)
    liquid = (1.0 - fraction) * math.exp(-(p - P0) / bulk_modulus)
    air = fraction * (P0 / p) ** (1.0 / exponent)
    return (liquid / bulk_modulus + air / (exponent * p)) / (liquid + air) - 1.0 / bulk_modulus


def compliance(pressure_a, pressure_b, volume_a, volume_b, bulk_modulus, fraction, exponent):
    if fraction <= 0.0:
        return 0.0, 0.0
    return (
        volume_a * excess(pressure_a, bulk_modulus, fraction, exponent),
        volume_b * excess(pressure_b, bulk_modulus, fraction, exponent),
    )


EFFECT = Effect(
    slot="compliance",
    summary="air bubbles that soften the oil at low pressure",
    kernel=compliance,
    parameters=(
        Parameter("fraction", "1", 0.01, (0.0, 0.2), "air by volume at atmospheric pressure, alpha",
                  "Jelali & Kroll (2003), ch. 3: 0.5 to 5 %", null=0.0),
        Parameter("exponent", "1", 1.4, (1.0, 1.4), "polytropic exponent n", "isothermal 1 to adiabatic 1.4"),
    ),
    equation="1/be = [(1-a)*e/b + a*(p0/p)^(1/n)/(n*p)] / [(1-a)*e + a*(p0/p)^(1/n)], e = exp(-(p-p0)/b)",
    source="Nykanen, Esque & Ellman (2000), PTMC; Merritt (1967), ch. 2",
    excited_by="resonance at several mean pressures, large pressure swings",
    confused_with=("hose_compliance", "structural_flexibility"),
    distinguished_by="resonance over mean pressure",
    wear="air in the oil: suction line, low tank",
)
