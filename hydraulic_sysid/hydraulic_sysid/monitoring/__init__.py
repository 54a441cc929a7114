"""One actuator over many bags, and many actuators beside each other: what changes, and which unit is different.

`estimates` fits the same parameters to each bag by itself. `change` tests each parameter for a change (CUSUM),
`trend` says how fast it grows and when it reaches a limit, `fleet` how likely a unit is not one of the others.
"""
