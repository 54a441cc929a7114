"""The plans of the study on a plant: through the node graph, or simulated on the model without one."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from hydraulic_bringup.demo import offline, online
from hydraulic_bringup.demo.online import Experiment, Steps
from hydraulic_sim.model import Model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.excitation import Plan, save_plan
from hydraulic_sysid.excitation.simulated_run import Sensors, simulate_plan

SENSORS = Sensors(
    position_noise=online.SENSORS["position_noise"],
    position_resolution=online.SENSORS["position_resolution"],
    pressure_noise=online.SENSORS["pressure_noise"],
    seed=int(online.SENSORS["noise_seed"]),
)
"""Those of the simulator in the graph."""


def save(plans: Sequence[Plan], folder: Path) -> list[Experiment]:
    """Write the plans, each with its prediction, and name the experiments that play them."""
    folder.mkdir(parents=True, exist_ok=True)
    experiments = []
    for plan in plans:
        file = folder / f"{plan.name}.yaml"
        save_plan(plan, file)
        experiments.append(Experiment(plan.name, file))
    return experiments


def through_the_graph(plans: Sequence[Plan], model: Path, plant: str, out: Path, steps: Steps) -> dict[str, Record]:
    """Play the plans one after the other and record them; plan's name → record.

    :raises DemoError: a step failed.
    """
    bags = online.run(plant, model, save(plans, out / "plans"), out, steps)
    return {plan.name: offline.read_bag(bag, steps, 0.0)[0] for plan, bag in zip(plans, bags, strict=True)}


def on_the_model(plans: Sequence[Plan], model: Model, steps: Steps) -> dict[str, Record]:
    """Simulate the plans with the sensors of the simulator; plan's name → record.

    :raises SimulationError: the model cannot follow.
    """
    plant = Plant(model)
    records = {}
    for plan in plans:
        records[plan.name] = simulate_plan(plan, plant, SENSORS).record
        steps.tick()
    return records
