"""The shares of what a model leaves, and what they mean in a sentence."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from hydraulic_sysid.data.display import percent, quantity

_NOISE_ONLY = 1.5  # mean squares of an error, over that of an exact model, up to which noise explains it


def shares(side: Mapping[str, float]) -> dict[str, float]:
    """Parts of the white box's mean squared error on test data; together 1.

    ``noise``: an exact model has it too; ``linear`` and ``nonlinear``: a black box explains it, the second only with
    nonlinear terms; ``unexplained``: what remains, which drive and motion of the white box do not determine. A black
    box that does harm on fresh data explains nothing.
    """
    whole = side["white"] ** 2
    if whole <= 0.0:
        return {"noise": 1.0, "linear": 0.0, "nonlinear": 0.0, "unexplained": 0.0}
    noise = min(side["exact"] ** 2 / whole, 1.0)
    most = 1.0 - noise
    linear = min(max(1.0 - side["linear"] ** 2 / whole, 0.0), most)
    both = min(max(1.0 - side["grey"] ** 2 / whole, linear), most)
    return {"noise": noise, "linear": linear, "nonlinear": both - linear, "unexplained": most - both}


def verdict(name: str, channels: Mapping[str, Any]) -> dict[str, str]:
    """How much is left that the physics of the model does not name."""
    key = next(iter(channels))
    side, part = channels[key]["test"], channels[key]["shares"]
    unit, title = channels[key]["unit"], channels[key]["title"]
    left = f"{name} misses {quantity(side['white'], unit)} of the {title} on test data"
    if all(c["test"]["white"] ** 2 <= _NOISE_ONLY * c["test"]["exact"] ** 2 for c in channels.values()):
        return {"level": "explained", "text": f"{left}, no more than noise explains: the physics names all there is."}
    unnamed = part["linear"] + part["nonlinear"]
    text = (
        f"{left}. A black box explains {percent(unnamed)} of its square, which the physics does not name "
        f"({percent(part['linear'])} linear, {percent(part['nonlinear'])} nonlinear); {percent(part['noise'])} is "
        f"noise, {percent(part['unexplained'])} neither."
    )
    terms = channels[key]["terms"]
    if unnamed > 0.1 and terms:
        text += f" Most telling: {terms[0]['name']}."
    level = "close" if unnamed < 0.3 else "off"
    return {"level": level, "text": text}
