"""The independent plant's own laws, each a small compiled function. Sources stand with each."""

from __future__ import annotations

import math

from numba import njit

P0 = 101325.0
BLEND = 2e4  # Pa: below this drop the orifice turns laminar
EDGE = 0.12  # rounding of overlapped and underlapped edges, of their width


@njit(inline="always")
def orifice(drop):
    """Root of the drop and its slope, Δp/(Δp² + ε²)^¼ (blending after Ellman & Piché, Trans. ASME 1999)."""
    square = drop * drop + BLEND * BLEND
    root = math.sqrt(square)
    quarter = math.sqrt(root)
    return drop / quarter, (0.5 * drop * drop + BLEND * BLEND) / (square * quarter)


@njit
def edge(lift, rounding):
    """Opening over a rounded metering edge; zero rounding is a sharp one."""
    if rounding <= 0.0:
        return max(lift, 0.0)
    return 0.5 * (lift + math.sqrt(lift * lift + rounding * rounding))


PLAYS = (0.7, 0.9, 1.1, 1.3)


@njit
def bent_play(value, width, held):
    """Rate-independent hysteresis of Prandtl & Ishlinskii: the mean of four plays whose half widths lie around
    ``width``, so that loops are round (Visintin 1994, ch. III). ``held`` (4,) is their memory."""
    total = 0.0
    for i in range(4):
        half = width * PLAYS[i]
        held[i] = min(max(held[i], value - half), value + half)
        total += held[i]
    return 0.25 * total


@njit
def opening(s, p, t, pa, pb, o_last):
    """Effective opening of the valve from the spool's position, ports and null included, lands not."""
    o = s + p.null_bias
    if p.null_drift != 0.0:
        o += p.null_drift * (1.0 - math.exp(-t / p.null_drift_time))
    if p.jet_force != 0.0:  # steady flow force (von Mises jet angle): closes with opening and drop
        drop = 0.5 * (p.supply - p.tank - (pa - pb if o_last > 0.0 else pb - pa))
        o -= p.jet_force * o_last * max(drop, 0.0) / (0.5 * (p.supply - p.tank))
    return o


@njit
def metering(o, p, t):
    """One land's relative area over its lift."""
    if p.gain_progression != 0.0:  # a bent window: slope 1−c at null, 1 at full opening, exponent 2.1
        size = min(abs(o), 2.0)
        o = o * (1.0 - p.gain_progression) + math.copysign(p.gain_progression * size**2.1, o)
    if p.gain_ripple != 0.0:
        o *= 1.0 + p.gain_ripple * math.sin(2.0 * math.pi * o / p.gain_ripple_length)
    if p.gain_asymmetry != 0.0:
        o *= 1.0 + p.gain_asymmetry * math.tanh(o / 0.01)
    if p.gain_drift != 0.0:
        o *= 1.0 + p.gain_drift * (1.0 - math.exp(-t / p.gain_drift_time))
    if p.opening_limit > 0.0:
        o = o / (1.0 + (abs(o) / p.opening_limit) ** 20) ** 0.05
    return o


@njit
def warmth(p, t):
    """Viscosity over that at the start: Reynolds' law with a temperature that settles exponentially."""
    if p.warming == 0.0:
        return 1.0
    return math.exp(math.log(1.0 + p.warming) * (1.0 - math.exp(-t / p.warming_time)))


@njit
def softness(pressure, p, beta):
    """1/β of oil with free air: Merritt's mixture rule with a polytropic gas (absolute pressure)."""
    if p.air <= 0.0:
        return 1.0 / beta
    absolute = max(pressure + P0, 2e4)
    return 1.0 / beta + p.air / (p.air_exponent * P0) * (P0 / absolute) ** (1.0 + 1.0 / p.air_exponent)


@njit
def past_piston(drop, x, p, thin):
    """Leakage from A to B and its slope: annular gap with entry loss (Δp = R·q + K·q²), plus the worn places."""
    q = 0.0
    slope = 0.0
    c = p.leakage * thin
    if p.barrel_leakage > 0.0:
        far = (x - p.barrel_place) / p.barrel_length
        c += p.barrel_leakage * math.exp(-far * far)
    if c > 0.0:
        loss = 2e-8 * abs(drop)  # entry loss takes some percent at several MPa
        root = math.sqrt(1.0 + 4.0 * loss)
        q = 2.0 * c * drop / (1.0 + root)
        slope = c / root
    if p.leakage_turbulent > 0.0:
        root, steep = orifice(drop)
        q += p.leakage_turbulent * root
        slope += p.leakage_turbulent * steep
    if p.relief > 0.0 and abs(drop) > p.relief_setting:
        q += p.relief * (drop - math.copysign(p.relief_setting, drop))
        slope += p.relief
    return q, slope


@njit(inline="always")
def oil_force(pa, pb, p):
    """Force of both pressures on the piston, N; written so that equal areas take the difference alone."""
    return (pa - pb) * p.area + pb * (p.area - p.area_b)


@njit
def friction_level(v, x, pa, pb, t, p):
    """Level of dry friction towards which the bristles bend, N (never negative)."""
    g = p.coulomb
    if p.coulomb_difference != 0.0:
        g += p.coulomb_difference * math.tanh(v / p.reversal_speed)
    if p.coulomb_growth != 0.0:  # hyperbolic cosine, same curvature in the middle
        far = p.growth_length
        g += p.coulomb_growth * 2.0 * far * far * (math.cosh(x / far) - 1.0)
    if p.periodic_friction != 0.0:
        g *= 1.0 + p.periodic_friction * math.sin(2.0 * math.pi * x / p.periodic_length)
    if p.seal_friction != 0.0:
        g += p.seal_friction * abs(pa - p.rest_pressure) + p.seal_friction * abs(pb - p.rest_pressure)
    if p.load_friction != 0.0:
        g += p.load_friction * abs(oil_force(pa, pb, p))
    if p.stribeck_rise != 0.0:
        ratio = v / p.stribeck_speed
        g += p.stribeck_rise * math.exp(-ratio * ratio)
    if p.friction_drift != 0.0:
        g *= 1.0 + p.friction_drift * (1.0 - math.exp(-t / p.friction_drift_time))
    return max(g, 1.0)


@njit
def outer_force(x, v, t, thin, p):
    """Forces on the piston besides pressures, bristles and other masses, N."""
    f = p.load - (p.viscous + p.viscous_difference * math.tanh(v / p.viscous_reversal_speed)) * thin * v
    if p.spring != 0.0:
        f -= p.spring * x * (1.0 + p.spring_curve * x * x)
    if p.square_drag != 0.0:
        f -= p.square_drag * v * abs(v)
    if p.cogging != 0.0:
        f -= p.cogging * math.sin(2.0 * math.pi * x / p.cogging_length)
    if p.hump_friction != 0.0:
        r = abs(v) / p.hump_speed
        f -= math.copysign(p.hump_friction * r * math.exp(1.0 - r), v)
    if p.shaker != 0.0:
        f += p.shaker * math.sin(2.0 * math.pi * p.shaker_frequency * t)
    if p.cushion > 0.0:
        depth = abs(x) - max(0.5 * p.stroke - p.cushion_length, 0.0)
        if depth > 0.0 and x * v > 0.0:
            # the spear's tapered slot closes the orifice: area ∝ 1/r, a little sharper towards the end
            r = min(depth / p.cushion_length, 1.0)
            f -= p.cushion * v * abs(v) * r * r * (0.95 + 0.1 * r)
    far = abs(x) - 0.5 * p.stroke
    if far > 0.0:
        side = 1.0 if x > 0.0 else -1.0
        f -= side * max(p.stop_stiffness * far + p.stop_damping * side * v, 0.0)
    return f


@njit
def contact(lead, lead_rate, p):
    """Pull of a load behind a gap, N: a contact between linear and Hertzian with Hunt & Crossley damping."""
    depth = abs(lead) - 0.5 * p.gap
    if depth <= 0.0:
        return 0.0
    side = 1.0 if lead > 0.0 else -1.0
    w = 2.0 * math.pi * p.gap_frequency
    # k·d^1.15, equal to the linear contact at the contact depth
    stiff = p.gap_mass * w * w * depth * (depth / p.contact_depth) ** 0.15
    damp = 2.0 * p.gap_damping * w * p.gap_mass * min(depth / p.contact_depth, 1.0)
    return side * max(stiff + damp * side * lead_rate, 0.0)
