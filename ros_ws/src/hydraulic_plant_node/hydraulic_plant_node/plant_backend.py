"""What a plant node needs from a plant: the seam between the contract and a simulated or real bench."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any

from hydraulic_interfaces.errors import HydraulicError
from hydraulic_interfaces.samples import PlantSample
from hydraulic_node_utils.parameter_spec import ParameterSpec
from hydraulic_plant_node.travel_limits import EndsOfTravel


class BackendError(HydraulicError, RuntimeError):
    """The plant cannot do what was asked of it; the text tells the user what is wrong and what to do."""


class PlantBackend(ABC):
    """A plant behind the contract. Lifecycle calls come from one thread, `step` from the plant loop's own.

    `configure` → `activate` → `step` … `step` → `deactivate` → `cleanup`; any of the first three may raise,
    preferably a `HydraulicError` with a text for the user.
    """

    hardware_id: str = "plant"
    """Shown in the diagnostics."""

    catch_up: int = 0
    """How many missed cycles are made up for, late but at their own sampling instants (a simulation can, a
    real plant cannot); what is missed beyond is skipped and counted."""

    tolerated_lateness: float = 1.0
    """A cycle that begins later than this share of the period is left out (beyond `catch_up`), and counted: its sample
    would be nearer to the next instant than to its own where the share is above one half."""

    warning: str = ""
    """What the user should know although nothing has to stop."""

    unprotected: Sequence[str] = ()
    """Protections that this plant does without, because somebody said so: shown at level WARN as long as it runs."""

    fault: str = ""
    """What is wrong with the plant while it is wrong: the node then holds 0 V until `reset`."""

    def parameters(self) -> Sequence[ParameterSpec]:
        """Parameters known before anything is loaded; their values come with `configure`."""
        return ()

    def hardware(self, values: Mapping[str, Any]) -> str:
        """Name of what a real actuator hangs on, "" where nothing real moves; asked before `configure`, same values."""
        return ""

    @abstractmethod
    def configure(self, values: Mapping[str, Any]) -> Sequence[ParameterSpec]:
        """Load, connect, compile: whatever takes long. Returns the parameters that are known only now."""

    def set_parameter(self, name: str, value: Any) -> None:  # noqa: B027 - nothing to set is a valid plant
        """Take the new value of a live parameter, from the next step on.

        :raises HydraulicError: the plant cannot take it, and nothing is changed: the parameter of the node then keeps
            its value too.
        """

    def sampling_rate(self, values: Mapping[str, Any]) -> float:
        """Rate of the steps, Hz; asked after `configure`, with the same values."""
        return float(values["rate"])

    def ends_of_travel(self) -> EndsOfTravel | None:
        """How drives are limited before the stops; asked after `configure`. None: they are not."""
        return None

    def description(self) -> Mapping[str, Any]:
        """What this plant is, as plain data; asked after `configure`, published, and kept with every record."""
        return {"hardware": self.hardware_id}

    @abstractmethod
    def activate(self) -> None:
        """Make ready to be stepped, at 0 V."""

    def first_instant(self, earliest_ns: int) -> int:
        """When the first step is due, at or after `earliest_ns` of the monotonic clock; the others follow by periods.

        A plant with a beat of its own keeps the loop in time with it here.
        """
        return earliest_ns

    def set_enabled(self, on: bool) -> None:  # noqa: B027 - a plant without an enable is a valid plant
        """Follow the gate: commands move the actuator from now on, or no longer."""

    @abstractmethod
    def step(self, stamp_ns: int, drive: float, dt: float) -> PlantSample | None:
        """The sample of the instant `stamp_ns`; `drive` [V] is applied from this instant on, for `dt` [s].

        `drive` is finite and within the limits. The sample's drive is what was really applied. None where the sensors
        gave no sample for this instant.
        """

    @abstractmethod
    def deactivate(self) -> None:
        """0 V and disabled. Called from any state, also after an error, and more than once."""

    def reset(self) -> None:  # noqa: B027 - a plant without faults of its own has nothing to reset
        """Clear `fault` where its cause is gone; raises BackendError where it is not."""

    def cleanup(self) -> None:  # noqa: B027 - nothing to release is valid
        """Release what `configure` took. Called once after each `configure`, also a failed one."""

    def report(self) -> Mapping[str, str]:
        """Further rows for the diagnostics."""
        return {}
