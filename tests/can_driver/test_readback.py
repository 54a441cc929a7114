"""What the devices do by themselves: read back, judged, told in words, as JSON and on the command line."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import pytest

from hydraulic_can_driver import readback
from hydraulic_can_driver.bus_file import SHIPPED, load_bus
from hydraulic_can_driver.verbs import inspect

NEUTRAL = {
    "upper_limit": 10.0,
    "lower_limit": -10.0,
    "scaling": 1.0,
    "directional_gain": 1.0,
}


def readings(**changed: float) -> dict[str, dict[str, float]]:
    valve = load_bus("bench").valve
    return {"valve": {row.name: NEUTRAL.get(row.name, 0.0) for row in valve.inspect} | changed}


def test_neutral_settings_imitate_nothing() -> None:
    found = readback.description(load_bus("bench"), readings())
    assert found["imitated_effects"] == [] and not any(r["acts"] for r in found["devices"]["valve"]["settings"])
    assert readback.sentences(load_bus("bench"), readings()) == []


@pytest.mark.parametrize(
    ("changed", "effects"),
    [
        ({"dead_band_type": 1, "dead_band_a": 0.3}, ["valve_deadband"]),
        ({"dead_band_a": 0.3}, []),  # its switch is off
        ({"ramp_type": 1, "ramp_up_time": 0.2}, ["spool_rate_limit"]),
        ({"zero_offset": 0.05}, ["valve_null_bias"]),
        ({"zero_offset": 0.0002}, []),  # less than half a count
        ({"upper_limit": 5.0, "directional_gain_type": 1}, ["valve_flow_saturation", "valve_gain_asymmetry"]),
        ({"deviation_monitor": 1}, []),  # shapes nothing
    ],
)
def test_what_is_not_neutral_is_named(changed: dict[str, float], effects: list[str]) -> None:
    found = readback.description(load_bus("bench"), readings(**changed))
    assert found["imitated_effects"] == effects
    assert json.loads(json.dumps(found)) == found


def test_sentences() -> None:
    assert readback.sentences(load_bus("bench"), readings(zero_offset=0.05)) == [
        "valve: zero_offset (0x6324:1) is 0.05 V, not 0 V, which looks like valve_null_bias"
    ]


def test_resolution_of_the_frames() -> None:
    found = readback.description(load_bus("bench"), {})["resolution"]
    assert found["position"] == {"value": 1e-6, "unit": "m"} and found["drive"]["value"] == pytest.approx(6.1e-4, 0.01)


def test_effects_are_those_of_the_library() -> None:
    from hydraulic_sim.registry import library

    named = {row.effect for node in load_bus("bench").nodes.values() for row in node.inspect if row.effect}
    assert named <= set(library()) | {"valve_flow"}


def test_verb_reads_and_writes_nothing(
    rig: Callable[..., Any], tmp_path: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    here = rig()
    here.devices.valve.store(0x6324, 1, 82)
    here.devices.valve.store(0x6342, 0, 1)
    written: list[Any] = []
    here.devices.listeners.append(lambda event: written.append(event) if event.kind == "sdo write" else None)
    place = ["--interface", "virtual", "--channel", here.bus.channel]
    assert inspect.main([*place, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["imitated_effects"] == ["valve_deadband", "valve_null_bias"] and written == []
    rows = {row["name"]: row for row in found["devices"]["valve"]["settings"]}
    assert rows["zero_offset"]["value"] == pytest.approx(0.05, abs=1e-3)
    assert inspect.main(place) == 0
    assert "imitate these effects of the hydraulics: valve_deadband, valve_null_bias" in " ".join(
        capsys.readouterr().out.split()
    )


def test_verb_says_what_is_wrong(tmp_path: Any, capsys: pytest.CaptureFixture[str]) -> None:
    assert inspect.main(["--bus", str(tmp_path / "none.yaml")]) == 2
    assert "cannot be read" in capsys.readouterr().err
    assert inspect.main(["--interface", "no such", "--channel", "x"]) == 1
    assert "CAN interface no such" in capsys.readouterr().err
    (tmp_path / "bus.yaml").write_text((SHIPPED / "bench.yaml").read_text().replace("profile: 406", "profile: 499"))
    assert inspect.main(["--bus", str(tmp_path / "bus.yaml"), "--interface", "virtual", "--channel", "nobody"]) == 1
    assert "no answer" in capsys.readouterr().err
