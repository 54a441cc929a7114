"""Electro-hydraulic servo actuator: physical effects, model files and compiled simulation.

Read in this order: `effect` (what an effect is), `effects/` (one effect, one file), `slots` (where effects
act), `compose` (effects become one flat right-hand side), `plant` (simulate it), `model_file` (what a user keeps).
"""
