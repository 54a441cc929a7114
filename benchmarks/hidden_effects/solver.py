"""The independent plant's solver: Strang splitting (kick, drift, kick) at fixed steps of 50 µs.

Momentum and the stores of energy (oil, springs, bristles) are advanced in turn, so that the hydraulic resonance
neither gains nor loses energy by the method (Hairer, Lubich & Wanner, Geometric Numerical Integration, ch. II).
Pressures are advanced by a linearly implicit midpoint rule with the exact 2×2 slope of the flows, bristles by their
exact solution at constant speed. Half-kicks are an explicit and an implicit one, which makes the pair second order.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from . import laws

SUBSTEPS = 20
P_DRAIN = 1.0e5  # Pa, where external leakage ends
RING = 8192  # substeps of true position kept for the sensor's dead time


@njit
def acceleration(x, v, pa, pb, z, x2, v2, x3, v3, t, thin, p):
    """Accelerations of piston, second mass and the mass behind the gap, and the bristles' rate."""
    g = laws.friction_level(v, x, pa, pb, t, p)
    stiff = p.coulomb / p.bristle
    rate = v - stiff * abs(v) * z / g
    damping = p.bristle_time * math.exp(-((v / 0.01) ** 2))  # fades with speed, else LuGre is not passive
    force = laws.oil_force(pa, pb, p) - stiff * (z + damping * rate) + laws.outer_force(x, v, t, thin, p)
    a2 = 0.0
    a3 = 0.0
    if p.second_mass > 0.0:
        w = 2.0 * math.pi * p.second_frequency
        pull = p.second_mass * (w * w * (x2 - x) + 2.0 * p.second_damping * w * (v2 - v))
        force += pull
        a2 = -pull / p.second_mass
    if p.gap_mass > 0.0:
        pull = laws.contact(x3 - x, v3 - v, p)
        force += pull
        a3 = -pull / p.gap_mass
    return force / p.mass, a2, a3


@njit
def simulate(p, feed, centring, noise_x, noise_a, noise_b, start, out, truth):
    """Fill ``out`` (n, 4): drive V, position m, pressures Pa, as recorded; ``truth`` (n, 7): position, velocity,
    pressures, supply, tank, opening.

    feed (n,) V before the feedback; noise (n,) each, m and Pa; start (5,): position, velocity, pressures, bristle.
    """
    n = len(feed)
    dt = 1e-3
    h = dt / SUBSTEPS
    half = 0.5 * h
    x, v, pa, pb, z = start[0], start[1], start[2], start[3], start[4]
    x2, v2, x3, v3 = x, v, x, v
    s, sr, s3 = 0.0, 0.0, 0.0
    slewed = 0.0
    ps, pt = p.supply, p.tank
    cycle_a, cycle_b = 0.5, 0.0
    o = 0.0
    creep_a, creep_b = pa, pb
    f1, f2 = x, x
    linkage = np.full(4, x)
    magnet = np.zeros(4)
    floor_x, floor_v = 0.0, 0.0
    seen_a, seen_b = pa, pb
    rate_a, rate_b = 0.0, 0.0
    ring = np.full(RING, x)
    count = 0
    gain = p.valve_flow / math.sqrt(p.valve_drop)
    width = max(p.overlap, p.underlap)
    rounding = laws.EDGE * width
    shift = p.underlap - p.overlap
    for k in range(n):
        t0 = k * dt
        # --- what the sensors say
        y = x
        if p.sensor_lag > 0.0:
            y = f2
        if p.sensor_delay > 0.0:
            back = p.sensor_delay / h
            whole = int(back)
            part = back - whole
            y = (1.0 - part) * ring[(count - whole) % RING] + part * ring[(count - whole - 1) % RING]
        if p.sensor_play > 0.0:
            y = laws.bent_play(y, p.sensor_play, linkage)
        if p.sensor_cubic > 0.0:
            size = 1.0 / math.sqrt(6.0 * p.sensor_cubic)
            y = size * math.sinh(y / size)
        elif p.sensor_cubic < 0.0:
            size = 1.0 / math.sqrt(-6.0 * p.sensor_cubic)
            y = size * math.sin(y / size)
        y = p.sensor_scale * y + p.sensor_offset + floor_x
        if p.sensor_drift != 0.0:
            y += p.sensor_drift * (1.0 - math.exp(-t0 / p.sensor_drift_time))
        code = math.floor((y + noise_x[k]) / p.sensor_step + 0.5)
        if p.missing_codes > 0.0:
            bit = 2.0**p.missing_codes
            code -= bit * (math.floor(code / bit) % 2.0)
        y = p.sensor_step * code
        u = min(max(feed[k] - centring * y, -p.drive_limit), p.drive_limit)
        out[k, 0] = u
        out[k, 1] = y
        out[k, 2] = (1.0 + p.transducer_gain) * seen_a + p.offset_a + noise_a[k]
        out[k, 3] = seen_b + p.offset_b + noise_b[k]
        truth[k, 0], truth[k, 1], truth[k, 2], truth[k, 3] = x, v, pa, pb
        truth[k, 4], truth[k, 5], truth[k, 6] = ps, pt, o
        for j in range(SUBSTEPS):
            t = t0 + (j + 0.5) * h
            thin = laws.warmth(p, t)
            # --- valve: command, spool, opening at the middle of the step
            late = int(math.floor((t - p.command_delay) / dt))
            command = out[late, 0] / p.drive_limit if late >= 0 else 0.0
            if p.hysteresis > 0.0:
                command = laws.bent_play(command, p.hysteresis, magnet)
            if p.spool_rate > 0.0:  # saturating pilot flow into the spool's end chambers
                slewed += h * p.spool_rate * math.tanh(1500.0 * (command - slewed) / p.spool_rate)
                command = slewed
            elif p.slew > 0.0:
                pace = p.slew if abs(command) > abs(slewed) else p.slew * (1.0 - p.slew_asymmetry)
                slewed += h * pace * math.tanh(1500.0 * (command - slewed) / pace)
                command = slewed
            if p.spool_frequency > 0.0:  # torque motor (fast pole, none in a direct-driven valve) before the spool
                w = 2.0 * math.pi * p.spool_frequency
                s3 += (command - s3) * (1.0 - math.exp(-h * p.spool_motor * w))
                bent = w * w * (s3 - s - half * sr) - 2.0 * p.spool_damping * w * sr
                sr_new = sr + h * bent / (1.0 + p.spool_damping * w * h + 0.25 * w * w * h * h)
                s_mid = s + 0.25 * h * (sr + sr_new)
                s += half * (sr + sr_new)
                sr = sr_new
            else:
                s_mid = command
            o = laws.metering(laws.opening(s_mid, p, t, pa, pb, o), p, t)
            forward = laws.edge(o + shift, rounding)
            backward = laws.edge(-o + shift, rounding)
            # --- first half-kick, explicit
            a1, a2, a3 = acceleration(x, v, pa, pb, z, x2, v2, x3, v3, t - half, thin, p)
            v += half * a1
            v2 += half * a2
            v3 += half * a3
            # --- drift: oil
            supply = ps
            if p.ripple != 0.0:
                turn = 2.0 * math.pi * p.ripple_frequency * t + p.ripple_phase
                supply += p.ripple * (math.sin(turn) + 0.1 * math.sin(2.0 * turn + 1.0))
            if p.limit_cycle != 0.0:
                supply += 0.5 * p.limit_cycle * cycle_a
            x_mid = x + half * v
            beta = p.bulk_modulus
            if p.bulk_drift != 0.0:
                beta *= 1.0 + p.bulk_drift * (1.0 - math.exp(-t / p.bulk_drift_time))
            mid_a = pa + half * rate_a
            mid_b = pb + half * rate_b
            ca = max(p.dead_volume + p.area * (0.5 * p.stroke + x_mid), 1e-6) * laws.softness(mid_a, p, beta)
            cb = max(p.dead_volume_b + p.area_b * (0.5 * p.stroke - x_mid), 1e-6) * laws.softness(mid_b, p, beta)
            if p.hose > 0.0:  # the wall stiffens a little as it is stretched
                ca += p.hose * (1.0 - 0.04 * (mid_a - p.rest_pressure) / p.rest_pressure)
                cb += p.hose * (1.0 - 0.04 * (mid_b - p.rest_pressure) / p.rest_pressure)
            root_pa, slope_pa = laws.orifice(supply - pa)
            root_at, slope_at = laws.orifice(pa - pt)
            root_pb, slope_pb = laws.orifice(supply - pb)
            root_bt, slope_bt = laws.orifice(pb - pt)
            leak, leak_slope = laws.past_piston(pa - pb, x_mid, p, 1.0 / thin)
            qa = gain * (forward * root_pa - backward * root_at) - leak - p.area * v
            qb = gain * (backward * root_pb - forward * root_bt) + leak + p.area_b * v
            out_slope = p.leakage_external / thin
            qa -= out_slope * (pa - P_DRAIN)
            qb -= out_slope * (pb - P_DRAIN)
            if p.hose_creep > 0.0:
                qa -= p.hose_creep * (pa - creep_a) / p.hose_creep_time
                qb -= p.hose_creep * (pb - creep_b) / p.hose_creep_time
                fade = 1.0 - math.exp(-h / p.hose_creep_time)
                creep_a += (pa - creep_a) * fade
                creep_b += (pb - creep_b) * fade
            ja = (gain * (forward * slope_pa + backward * slope_at) + leak_slope + out_slope) / ca
            jb = (gain * (backward * slope_pb + forward * slope_bt) + leak_slope + out_slope) / cb
            jab = leak_slope / ca
            jba = leak_slope / cb
            fa = qa / ca
            fb = qb / cb
            det = (1.0 + half * ja) * (1.0 + half * jb) - half * half * jab * jba
            rate_a = ((1.0 + half * jb) * fa + half * jab * fb) / det
            rate_b = ((1.0 + half * ja) * fb + half * jba * fa) / det
            pa += h * rate_a
            pb += h * rate_b
            drawn = gain * (forward * root_pa + backward * root_pb)
            returned = gain * (backward * root_at + forward * root_bt)
            # --- drift: positions, bristles
            x += h * v
            x2 += h * v2
            x3 += h * v3
            g = laws.friction_level(v, x_mid, pa, pb, t, p)
            bend = p.coulomb / p.bristle * abs(v) / g
            if bend * h > 1e-9:
                fade = math.exp(-bend * h)
                z = z * fade + v * (1.0 - fade) / bend
            else:
                z += h * v
            # --- second half-kick, implicit in the speeds (slope by difference)
            a1, a2, a3 = acceleration(x, v, pa, pb, z, x2, v2, x3, v3, t + half, thin, p)
            dv = 1e-7
            b1, _, _ = acceleration(x, v + dv, pa, pb, z, x2, v2 + dv, x3, v3 + dv, t + half, thin, p)
            slope = min((b1 - a1) / dv, 0.0)
            v += half * a1 / (1.0 - half * slope)
            v2 += half * a2
            v3 += half * a3
            # --- supply and return, staggered by half a step
            if p.droop > 0.0:  # pump with a falling characteristic, accumulator with a polytropic gas
                stiff = (p.supply / max(ps, 1e6)) ** 1.8333
                ps += h * (p.supply - p.droop * drawn - ps) / (p.droop_time * stiff)
            if p.back_pressure > 0.0:  # return line between laminar and fully rough (exponent 1.85)
                rise = p.back_pressure * returned * returned * (abs(returned) / p.return_flow + 1e-3) ** -0.15
                pt += (p.tank + math.copysign(rise, returned) - pt) * (1.0 - math.exp(-h / p.back_pressure_time))
            if p.limit_cycle != 0.0:  # van der Pol's relaxation oscillation
                w = 2.0 * math.pi * p.limit_cycle_frequency * 1.8
                cycle_b += h * w * (4.0 * (1.0 - cycle_a * cycle_a) * cycle_b - cycle_a)
                cycle_a += h * w * cycle_b
            # --- sensors that remember
            count += 1
            ring[count % RING] = x
            if p.sensor_lag > 0.0:  # demodulator with one slow and one fast pole
                f1 += (x - f1) * (1.0 - math.exp(-h / (0.92 * p.sensor_lag)))
                f2 += (f1 - f2) * (1.0 - math.exp(-h / (0.08 * p.sensor_lag)))
            if p.foundation > 0.0:
                w = 2.0 * math.pi * p.foundation_frequency
                push = p.foundation * laws.oil_force(pa, pb, p)
                floor_v += h * (w * w * (push - floor_x) - 0.1 * w * floor_v)
                floor_x += h * floor_v
            if p.transducer_lag > 0.0:
                fade = 1.0 - math.exp(-h / p.transducer_lag)
                seen_a += (pa - seen_a) * fade
                seen_b += (pb - seen_b) * fade
            else:
                seen_a, seen_b = pa, pb
