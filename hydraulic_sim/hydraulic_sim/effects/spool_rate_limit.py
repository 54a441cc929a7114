"""Spool rate limit: the spool moves no faster than its pilot stage allows.

    |ds/dt| ≤ r;   the demand handed on is the mean of the limited ramp over each sample

Source: Merritt (1967), Hydraulic Control Systems, ch. 7 (velocity saturation of two-stage valves).
"""

from hydraulic_sim.effect import Effect, Parameter

IDEAL = 1e4  # 1/s: at this bound nothing is limited


def limit_rate(command, memory, dt, rate):
    if rate >= IDEAL:
        return command
    if memory[0] == 0.0:
        memory[0] = 1.0
        memory[1] = command
    start = memory[1]
    gap = command - start
    reach = rate * dt
    if abs(gap) <= reach:
        memory[1] = command
        ramp = abs(gap) / reach
        return start + gap * (1.0 - 0.5 * ramp)
    step = reach if gap > 0.0 else -reach
    memory[1] = start + step
    return start + 0.5 * step


EFFECT = Effect(
    slot="command",
    summary="limited speed of the spool",
    kernel=limit_rate,
    memory=2,
    parameters=(
        Parameter("rate", "1/s", 30.0, (0.5, IDEAL), "largest speed of the spool, full openings per second",
                  "two-stage valves: full stroke in 5 to 50 ms", null=IDEAL),
    ),
    equation="|ds/dt| <= r",
    source="Merritt (1967), Hydraulic Control Systems, ch. 7",
    excited_by="large steps and fast large sines",
    confused_with=("spool_dynamics", "command_delay"),
    distinguished_by="phase that depends on amplitude",
    order=30,
)
