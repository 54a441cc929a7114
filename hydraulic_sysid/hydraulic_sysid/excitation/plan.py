"""The excitation plan: one file from which the whole drive of an experiment follows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from hydraulic_interfaces.contract import DRIVE_LIMIT_V
from hydraulic_node_utils.whole_file import write_text
from hydraulic_node_utils.yaml_text import load_yaml
from hydraulic_sim.arrays import Array
from hydraulic_sysid.excitation.declared import Declared, number, section, text
from hydraulic_sysid.excitation.errors import ExcitationError, PlanError
from hydraulic_sysid.excitation.signals import Signal, signal_kinds

PLAN_FOLDER = Path(__file__).parent / "plans"


@dataclass(frozen=True)
class Prediction(Declared):
    """The extremes of the plan simulated on a model, and what kept its amplitude from being larger."""

    label = "prediction"

    model: str = text("the model it was simulated on")
    drive_peak: float = number("V", "largest drive, centring included", minimum=0.0, maximum=1e3)
    position_min: float = number("m", "least position", minimum=-1e3, maximum=1e3)
    position_max: float = number("m", "greatest position", minimum=-1e3, maximum=1e3)
    velocity_peak: float = number("m/s", "greatest speed", minimum=0.0, maximum=1e3)
    pressure_min: float = number("Pa", "least pressure of both chambers", minimum=-1e9, maximum=1e9)
    pressure_max: float = number("Pa", "greatest pressure of both chambers", minimum=-1e9, maximum=1e9)
    limited_by: str = text("what allows no larger amplitude", "")


@dataclass(frozen=True)
class Plan(Declared):
    """What is played: a signal, how it is faded in and out, centred and bounded.

    The drive without centring is w(t)·(offset + signal(t)), where w is 0 during both rests and rises and
    falls as a raised cosine within `duration`. Two equal plans give equal arrays, on any machine. In the
    `approach` before all that the piston is brought to the centre, from wherever it stands; there the travel
    limit does not count.
    """

    label = ""

    name: str = text("name of the experiment; records are named after it")
    signal: Signal = section("what is played", Signal)
    travel_limit: float = number("m", "a piston further from the centre aborts the run", above=0.0, maximum=100.0)
    description: str = text("what the experiment is for", "")
    duration: float | None = number(
        "s", "of the signal, fades included; left out: the signal's own length", None, above=0.0, maximum=3600.0
    )
    rate: float = number("Hz", "samples per second of the drive", 1000.0, minimum=1.0, maximum=10000.0)
    amplitude_limit: float = number("V", "no drive goes beyond it", DRIVE_LIMIT_V, above=0.0, maximum=DRIVE_LIMIT_V)
    offset: float = number("V", "added to the signal", 0.0, minimum=-DRIVE_LIMIT_V, maximum=DRIVE_LIMIT_V)
    fade_in: float = number("s", "raised cosine at the start", 0.5, minimum=0.0, maximum=60.0)
    fade_out: float = number("s", "raised cosine at the end", 0.5, minimum=0.0, maximum=60.0)
    rest_before: float = number("s", "0 V before the signal", 0.5, minimum=0.0, maximum=60.0)
    rest_after: float = number("s", "0 V after the signal", 0.5, minimum=0.05, maximum=60.0)
    centre: float = number(
        "m", "where centring pulls the piston to; 0 is mid stroke", 0.0, minimum=-100.0, maximum=100.0
    )
    centring_gain: float = number("V/m", "drive per distance from the centre", 2.0, minimum=0.0, maximum=1000.0)
    centring_limit: float = number("V", "centring asks for no more", 0.5, minimum=0.0, maximum=DRIVE_LIMIT_V)
    approach: float = number(
        "s", "brings the piston to the centre before the first rest", 0.0, minimum=0.0, maximum=60.0
    )
    approach_gain: float = number("V/m", "drive per distance during the approach", 20.0, minimum=0.0, maximum=1000.0)
    approach_limit: float = number("V", "the approach asks for no more", 3.0, minimum=0.0, maximum=DRIVE_LIMIT_V)
    prediction: Prediction | None = section("what a model does under this plan", Prediction, None)

    def check(self) -> None:
        """Check what no single key can: duration, drive and travel against the signal."""
        if self.duration is None:
            if self.signal.length is None:
                raise self.error(
                    "duration", None, f"a number above 0 s: a {self.signal.label} has no length of its own"
                )
            object.__setattr__(self, "duration", self.signal.length)
        if self.fade_in + self.fade_out > self.active_time:
            raise self.error(
                "fade_in + fade_out", self.fade_in + self.fade_out, f"up to {self.active_time:g} s (duration)"
            )
        if 2.0 * self.signal.highest_frequency > self.rate:
            allowed = f"at least {2.0 * self.signal.highest_frequency:g} Hz, twice the signal's highest frequency"
            raise self.error("rate", self.rate, allowed)
        peak = float(np.max(np.abs(self.open_loop), initial=0.0))
        if peak > self.amplitude_limit * (1 + 1e-12):
            raise self.error(
                "amplitude_limit", self.amplitude_limit, f"at least {peak:.6g} V, the peak of this plan's drive"
            )

    @property
    def active_time(self) -> float:
        """Duration of the signal [s], fades included."""
        assert self.duration is not None  # filled in by check()
        return self.duration

    @property
    def signal_start(self) -> float:
        """Where the signal begins [s], from the start of the run."""
        return self.approach + self.rest_before

    @property
    def total_time(self) -> float:
        """Duration of the run [s], approach and rests included."""
        return self.signal_start + self.active_time + self.rest_after

    @cached_property
    def time(self) -> Array:
        """Sampling times [s] from the start of the run, (N,)."""
        return np.arange(round(self.total_time * self.rate)) / self.rate

    @cached_property
    def envelope(self) -> Array:
        """The weight w of signal and centring, 0 … 1, (N,)."""
        since, left = self.time - self.signal_start, self.signal_start + self.active_time - self.time
        slack = 1e-6 / self.rate
        active = (since > -slack) & (left > slack)
        return np.where(active, _raised_cosine(since, self.fade_in) * _raised_cosine(left, self.fade_out), 0.0)

    @cached_property
    def open_loop(self) -> Array:
        """The drive without centring [V], (N,)."""
        active = self.envelope > 0.0
        drive = np.zeros(self.time.size)
        drive[active] = self.envelope[active] * (
            self.offset + self.signal.sample(self.time[active] - self.signal_start)
        )
        return drive

    @classmethod
    def from_mapping(cls, mapping: Mapping[str, Any], folder: Path | None = None) -> Plan:
        """Build from the content of a plan file; see `Declared.from_mapping`."""
        values = dict(mapping)
        values["signal"] = _signal(values.get("signal"), folder)
        if isinstance(values.get("prediction"), Mapping):
            values["prediction"] = Prediction.from_mapping(values["prediction"])
        return super().from_mapping(values, folder)

    def as_mapping(self) -> dict[str, Any]:
        """Plain YAML and JSON values; `from_mapping` gives an equal plan back."""
        signal = {"kind": _kind(self.signal), **self.signal.as_mapping()}
        values = super().as_mapping()
        first = {"name": values.pop("name"), "description": values.pop("description")}
        if self.prediction is not None:
            values["prediction"] = self.prediction.as_mapping()
        return {**first, **values, "signal": signal}


def _raised_cosine(t: Array, fade: float) -> Array:
    if fade == 0.0:
        return np.ones(t.shape)
    return 0.5 - 0.5 * np.cos(np.pi * np.clip(t / fade, 0.0, 1.0))


def _kind(signal: Signal) -> str:
    return next(name for name, kind in signal_kinds().items() if kind is type(signal))


def _signal(content: Any, folder: Path | None) -> Signal:
    kinds = signal_kinds()
    if not isinstance(content, Mapping) or "kind" not in content:
        raise PlanError("", "signal", content, f"a section with kind: {' | '.join(kinds)}, and the kind's parameters")
    kind = content["kind"]
    if kind not in kinds:
        raise PlanError("signal", "kind", kind, " | ".join(kinds))
    values = {key: value for key, value in content.items() if key != "kind"}
    try:
        return kinds[kind].from_mapping(values, folder)
    except PlanError as error:
        raise error.inside("signal") from None


def _yaml() -> YAML:
    yaml = YAML(typ="safe", pure=True)
    yaml.default_flow_style = False
    yaml.sort_base_mapping_type_on_output = False  # type: ignore[assignment]
    return yaml


def shipped_plans() -> dict[str, Path]:
    """The plans that come with the package, by name."""
    return {file.stem: file for file in sorted(PLAN_FOLDER.glob("*.yaml"))}


def load_plan(source: str | Path) -> Plan:
    """The plan of a file, or a shipped one by its name ("chirp").

    :raises PlanError: not allowed; names file, key, value and what is allowed.
    :raises PlaybackError: the file that a playback names is not readable.
    """
    file = Path(source)
    if not file.is_file():
        file = shipped_plans().get(str(source), file)
    try:
        content = load_yaml(_yaml(), file.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, YAMLError) as error:
        known = ", ".join(shipped_plans())
        raise ExcitationError(f"{file}: is not a readable plan: {error}; plans by name: {known}") from error
    if not isinstance(content, Mapping):
        raise PlanError(str(file), "content", content, "a YAML mapping with at least name, signal and travel_limit")
    try:
        return Plan.from_mapping(content, file.resolve().parent)
    except PlanError as error:
        raise error.inside(str(file)) from None


def save_plan(plan: Plan, file: str | Path, overwrite: bool = False) -> None:
    """Write `plan` to a YAML file; an existing file is only replaced with `overwrite`.

    :raises ExcitationError: the file exists, or cannot be written.
    """
    if Path(file).exists() and not overwrite:
        raise ExcitationError(f"{file}: plan not written: it exists")
    content = StringIO()
    _yaml().dump(plan.as_mapping(), content)
    try:
        write_text(Path(file), content.getvalue())
    except OSError as error:
        raise ExcitationError(f"{file}: plan not written: {error.strerror}") from error
