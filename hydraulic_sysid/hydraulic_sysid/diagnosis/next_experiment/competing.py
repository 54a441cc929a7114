"""The models that an experiment is to tell apart: from files, or from a diagnosis that could not decide."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from hydraulic_sim.model_file import Model, load_model

from .errors import NextExperimentError


def of_diagnosis(folder: Path, diagnosis: Mapping[str, Any]) -> dict[str, Model]:
    """The models between which the diagnosis in a folder could not decide, by the effects that only they have.

    :param diagnosis: its document
    :raises NextExperimentError: the folder holds less than two.
    """
    files = {file.stem.removeprefix("competing_"): file for file in sorted(folder.glob("competing_*.yaml"))}
    found = {name: load_model(str(file)) for name, file in files.items()}
    own = folder / "model.yaml"
    if own.is_file():
        model = load_model(str(own))
        left = [n for n in diagnosis["verdict"].get("effects", ()) if n not in found and n in model.effects]
        if left:
            found = {"+".join(left): model, **found}
    if len(found) < 2:
        raise NextExperimentError(
            f"{folder}: holds {len(found)} competing models (competing_<effect>.yaml, model.yaml); two or more are "
            f"needed. Its verdict: {diagnosis['verdict'].get('text', '')}"
        )
    return found


def of_files(files: Sequence[str]) -> dict[str, Model]:
    """Models by the effects that only they have, or by their files' names where these do not tell them apart.

    :raises NextExperimentError: the same model twice.
    """
    models = [load_model(file) for file in files]
    common = set.intersection(*(set(m.effects) for m in models))
    names = ["+".join(e for e in m.effects if e not in common) for m in models]
    if len(set(names)) < len(names) or "" in names:
        names = [Path(file).stem for file in files]
    if len(set(names)) < len(names):
        raise NextExperimentError(f"the same model twice: {', '.join(files)}")
    return dict(zip(names, models, strict=True))
