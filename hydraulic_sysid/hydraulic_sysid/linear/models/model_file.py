"""Identified models as files: JSON that a controller's tuning reads without this package.

Numbers are written with all their digits (a pole at 1 needs them). `docs/report-json.md` describes the format.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np

from hydraulic_node_utils.json_file import read_json
from hydraulic_node_utils.whole_file import write_text
from hydraulic_sysid.data.results import EVERY_DIGIT, plain
from hydraulic_sysid.linear.errors import IdentificationError

from .arx import ArxModel, ArxOrder
from .model import LinearModel
from .state_space import StateSpaceModel
from .transfer_function import TransferFunctionModel, TransferFunctionOrder

FORMAT = "hydraulic-linear-model-2"
_READABLE = (FORMAT, "hydraulic-linear-model-1")  # whose figures on test data stand under another key
_KINDS: dict[type, str] = {ArxModel: "arx", TransferFunctionModel: "transfer function", StateSpaceModel: "state space"}


def document(model: LinearModel, **about: Any) -> dict[str, Any]:
    """The file's content; ``about``: further keys (name, input, output, quality, …) that come first."""
    orders = (ArxOrder, TransferFunctionOrder)
    return {
        "format": FORMAT,
        **about,
        "structure": _KINDS[type(model)],
        **transfer_function(model),
        "poles": poles(model),
        "estimate": {k: dict(vars(v)) if isinstance(v, orders) else v for k, v in vars(model).items()},
    }


def transfer_function(model: LinearModel) -> dict[str, Any]:
    """Domain, sampling time, numerator, denominator and dead time of a model."""
    numerator, denominator = model.transfer_function()
    continuous = isinstance(model, TransferFunctionModel)
    return {
        "domain": "continuous" if continuous else "discrete",
        "sampling_time": model.dt,
        "numerator": numerator,
        "denominator": denominator,
        "delay": model.delay if isinstance(model, TransferFunctionModel) else 0.0,
    }


def poles(model: LinearModel) -> list[dict[str, Any]]:
    """The poles of a model, slowest first."""
    return [
        {
            "real": p.value.real,
            "imaginary": p.value.imag,
            "natural_frequency_hz": p.natural_frequency,
            "damping": p.damping,
            "stable": p.stable,
        }
        for p in model.poles()
    ]


def write_linear_model(path: Path, model: LinearModel, **about: Any) -> Path:
    """Write the file, whole or not at all, over an earlier one of this format.

    :raises IdentificationError: something else lies there.
    """
    check_place(path)
    content = plain(document(model, **about), EVERY_DIGIT)
    write_text(path, json.dumps(content, indent=1, allow_nan=False, ensure_ascii=False) + "\n")
    return path


def check_place(path: Path) -> None:
    """Find out whether a model may be written there.

    :raises IdentificationError: something else than such a file lies there.
    """
    if path.exists():
        read_document(path)


def read_document(path: Path) -> dict[str, Any]:
    """The content of a file.

    :raises IdentificationError: no file, or not of this format.
    """
    content = read_json(path, IdentificationError)
    found = content.get("format") if isinstance(content, dict) else None
    if found not in _READABLE:
        raise IdentificationError(f"{path}: format is {found!r}, expected {FORMAT!r}")
    return dict(content)


def read_linear_model(path: Path) -> tuple[LinearModel, dict[str, Any]]:
    """The model in a file, able to run, and the whole content.

    :raises IdentificationError: no file, not of this format, or a value is missing.
    """
    content = read_document(path)
    try:
        values: dict[str, Any] = {
            key: np.asarray([math.nan if v is None else v for v in value] if _flat(value) else value, dtype=float)
            if isinstance(value, list)
            else value
            for key, value in content["estimate"].items()
        }
        kind = content["structure"]
        if kind == "arx":
            return ArxModel(**{**values, "order": ArxOrder(**values["order"])}), content
        if kind == "transfer function":
            return TransferFunctionModel(**{**values, "order": TransferFunctionOrder(**values["order"])}), content
        if kind == "state space":
            return StateSpaceModel(**values), content
    except (KeyError, TypeError, ValueError) as error:
        raise IdentificationError(f"{path}: not a complete model ({error})") from error
    raise IdentificationError(f"{path}: structure is {kind!r}, allowed are {', '.join(_KINDS.values())}")


def _flat(value: list[Any]) -> bool:
    return not any(isinstance(v, list) for v in value)
