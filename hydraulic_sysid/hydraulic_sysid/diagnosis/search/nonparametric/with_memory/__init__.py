"""Unknown additions that remember: over a variable that follows one of the motion late, by a lag of order 1.

Each names the variable that its state ``FOLLOWS``; the time constant is its parameter ``lag``. Hysteresis without a
law of its own looks like this: what yields before it moves, and what answers late.
"""
