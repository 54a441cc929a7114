"""The simulator node: what it adds to the contract, over a real process."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from hydraulic_interfaces.conversions import from_time
from hydraulic_sim.model_file import load_model
from hydraulic_sim.plant import Plant

PLANT = "/actuator/plant"
MODEL = "sample_bench"
RATE = 200.0  # low, so that the collecting test process keeps up on a busy machine


@pytest.fixture
def start(launch: Any, compiled_physics: None) -> Callable[..., Any]:
    def run(*parameters: str, autostart: bool = True) -> Any:
        options = ["--autostart"] if autostart else []
        given = [f"model:={MODEL}", f"rate:={RATE}", "watchdog:=2.0", "enable_on_activate:=true", *parameters]
        return launch("hydraulic_sim.nodes.simulator", *options, "--ros-args", *[x for p in given for x in ("-p", p)])

    return run


def set_parameter(client: Any, name: str, value: float | str) -> Any:
    from rcl_interfaces.msg import Parameter, ParameterValue

    content = {"type": 4, "string_value": value} if isinstance(value, str) else {"type": 3, "double_value": value}
    change = Parameter(name=name, value=ParameterValue(**content))
    return client.call("rcl_interfaces/srv/SetParameters", f"{PLANT}/set_parameters", parameters=[change]).results[0]


def arrays(states: list[Any]) -> dict[str, np.ndarray]:
    """Columns of state messages up to the first gap in the stamps."""
    stamps = np.array([from_time(m.header.stamp) for m in states])
    whole = int(np.argmax(np.append(np.diff(stamps) != round(1e9 / RATE), True))) + 1
    rows = states[:whole]
    return {
        "stamp_ns": stamps[:whole],
        "position": np.array([m.position[0] for m in rows]),
        "spool": np.array([m.position[1] for m in rows]),
        "velocity": np.array([m.velocity[0] for m in rows]),
        "force": np.array([m.effort[0] for m in rows]),
        "drive": np.array([m.effort[1] for m in rows]),
    }


def test_the_topics_carry_what_the_model_computes(start: Any, client: Any, wait_until: Any) -> None:
    states, pressures = client.collect("state"), client.collect("pressure_a")
    start("initial_position:=0.1", autostart=False)
    assert client.change_state("configure")
    wait_until(lambda: client.node.count_publishers("/actuator/state") == 1, "a publisher of state")
    assert client.change_state("activate")
    wait_until(lambda: states, "a state")
    source = client.source("hand", 2.0)
    wait_until(lambda: states[-1].effort[1] == 2.0, "the drive")
    source.drive = -3.0
    wait_until(lambda: states[-1].effort[1] == -3.0 and len(states) > 150, "the other drive")
    heard = arrays(list(states))
    assert len(heard["drive"]) > 100
    plant = Plant(load_model(MODEL))
    # A collector that joined late would have missed the rest before the drive, during which nothing happens.
    simulated = plant.simulate(heard["drive"], 1.0 / RATE, plant.initial_state(position=0.1))
    for channel in ("position", "velocity", "force"):
        assert heard[channel] == pytest.approx(simulated[channel], rel=1e-6, abs=1e-9 * np.ptp(simulated[channel]))
    assert heard["spool"] == pytest.approx(simulated.spool * plant.value("spool_travel"), rel=1e-6, abs=1e-9)
    at = {int(stamp): k for k, stamp in enumerate(heard["stamp_ns"])}
    both = [(at[stamp], m.fluid_pressure) for m in list(pressures) if (stamp := from_time(m.header.stamp)) in at]
    assert len(both) > 100
    assert [p for _, p in both] == pytest.approx(simulated.pressure_a[[k for k, _ in both]], rel=1e-6)


def test_a_bad_model_is_refused_and_another_taken(start: Any, client: Any) -> None:
    process = start("model:=/no/such/model.yaml", autostart=False)
    assert not client.change_state("configure")
    process.says("cannot configure: /no/such/model.yaml")
    assert client.state() == "unconfigured"
    assert set_parameter(client, "model", MODEL).successful
    assert client.change_state("configure")
    refused = set_parameter(client, "model", MODEL)
    assert not refused.successful and "clean up" in refused.reason


def test_an_initial_position_outside_the_stroke_is_refused(start: Any, client: Any) -> None:
    process = start("initial_position:=9.0", autostart=False)
    assert not client.change_state("configure")
    process.says("initial_position is 9 m, outside the stroke of sample_bench")


def test_parameters_of_the_model(start: Any, client: Any, wait_until: Any) -> None:
    states = client.collect("state")
    start("model.supply_pressure:=10.0e6")
    supplies = client.collect("pressure_supply")
    wait_until(lambda: supplies and supplies[-1].fluid_pressure == 10e6, "the value given at the start")
    assert set_parameter(client, "model.supply_pressure", 12e6).successful
    wait_until(lambda: supplies[-1].fluid_pressure == 12e6, "the value set while running")
    refused = set_parameter(client, "model.supply_pressure", -1.0)
    assert not refused.successful
    assert states
    answer = client.call(
        "rcl_interfaces/srv/DescribeParameters", f"{PLANT}/describe_parameters", names=["model.moving_mass"]
    )
    assert answer.descriptors[0].description.endswith("[kg]")
    assert answer.descriptors[0].floating_point_range


def test_limit_switches_close_at_the_stops(start: Any, client: Any, wait_until: Any) -> None:
    half = 0.5 * load_model(MODEL).value("stroke")
    extended, retracted = client.collect("limit_extended"), client.collect("limit_retracted")
    states = client.collect("state")
    start(f"initial_position:={half - 0.02}")
    wait_until(lambda: extended and not extended[-1].data, "an open limit switch")
    client.source("hand", 5.0)
    wait_until(lambda: extended[-1].data, "the closed limit switch")
    wait_until(lambda: states[-1].position[0] > half - 2e-3, "the piston at the stop")
    assert not any(message.data for message in retracted)


def test_sensor_noise_and_resolution(start: Any, client: Any, wait_until: Any) -> None:
    states, pressures = client.collect("state"), client.collect("pressure_b")
    start("position_noise:=1e-5", "position_resolution:=2e-6", "pressure_noise:=2e4", "noise_seed:=7")
    wait_until(lambda: len(states) > 800 and len(pressures) > 800, "samples at rest")
    position = arrays(list(states))["position"][:800]
    assert np.std(position) == pytest.approx(1e-5, rel=0.15)
    assert position / 2e-6 == pytest.approx(np.round(position / 2e-6), abs=1e-6)
    pressure = np.array([m.fluid_pressure for m in pressures[:800]])
    assert np.std(pressure) == pytest.approx(2e4, rel=0.15)
    assert abs(np.corrcoef(pressure[:-1], pressure[1:])[0, 1]) < 0.1, "white"


def test_the_diagnostics_name_the_model(start: Any, client: Any, wait_until: Any) -> None:
    health = client.diagnostics()
    start()
    wait_until(lambda: health["model"] == MODEL and "coulomb_friction" in health["effects"], "the model's name")


def test_effects_can_be_switched_on_and_off_while_it_runs(start: Any, client: Any, wait_until: Any) -> None:
    health, states = client.diagnostics(), client.collect("state")
    start("model:=moog_mcr_m_1002_bench")
    client.source("hand", 0.3)
    wait_until(lambda: len(states) > 50 and states[-1].velocity[0] > 5e-3, "the piston to move")
    assert set_parameter(client, "extra_effects", "{valve_deadband: {width: 0.05}, supply_droop: }").successful
    wait_until(lambda: abs(states[-1].velocity[0]) < 1e-3, "the piston to stand within the dead band")
    wait_until(lambda: "valve_deadband, supply_droop" in health["effects"], "the effects in the diagnostics")
    for text, complaint in (
        ("{warp_drive: }", "warp_drive"),
        ("{valve_deadband: {width: 9.0}}", "width"),
        ("{coulomb_friction: }", "own effects"),
        ("[valve_deadband]", "mapping"),
        ("{valve_deadband: {width: wide}}", "number"),
        ("{", "YAML"),
    ):
        refused = set_parameter(client, "extra_effects", text)
        assert not refused.successful and complaint in refused.reason, text
    assert set_parameter(client, "extra_effects", "").successful
    wait_until(lambda: states[-1].velocity[0] > 5e-3, "the piston to move again")
    wait_until(lambda: "deadband" not in health["effects"], "the effects gone from the diagnostics")


@pytest.mark.parametrize("speed", [0.0, 0.05])
def test_the_simulator_brakes_before_its_stops_only_where_it_is_asked_to(speed: float) -> None:
    from hydraulic_sim.nodes.simulator import Simulator

    plant = Simulator()
    values = {spec.name: spec.default for spec in plant.parameters()}
    plant.configure({**values, "rate": 1000.0, "impact_speed": speed})
    ends = plant.ends_of_travel()
    if not speed:
        assert ends is None
        return
    assert ends is not None and (ends.low, ends.high, ends.impact_speed) == (-0.762, 0.762, speed)
    assert 0.44 < ends.full_speed < 0.7, "with the whole pressure over one land"
