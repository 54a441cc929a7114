"""The managed node that serves a plant, simulated or real: command gate, plant loop, pacing, health."""
