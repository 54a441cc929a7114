"""Bandwidth: closed forms, the linearised model, a probe's record, and the excitation node's action."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from hostile_page import assert_cannot_inject

from hydraulic_node_utils.cli import run_verb
from hydraulic_sim.linear import closed_form
from hydraulic_sim.model_file import load_model
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.excitation import load_plan
from hydraulic_sysid.linear.bandwidth import BandwidthError, from_model, from_record, from_response, from_simulation

BENCH = "moog_mcr_m_1002_bench"


def third_order(gain: float, natural: float, damping: float, top: float = 1e3) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies [Hz] and response of K/(s·(s²/ω² + 2ζs/ω + 1))."""
    f = np.geomspace(1e-3, top, 20_001)
    s = 2j * np.pi * f
    return f, gain / (s * (s**2 / natural**2 + 2.0 * damping * s / natural + 1.0))


@pytest.mark.parametrize(("natural", "damping"), [(100.0, 0.1), (250.0, 0.3), (60.0, 0.7)])
def test_the_third_order_model_has_its_textbook_values(natural: float, damping: float) -> None:
    """Critical gain K = 2ζω/K_v at ω (Merritt 1967, sec. 8.1); −3 dB of the velocity by the closed form of a
    second-order lag."""
    found = from_response(*third_order(0.04, natural, damping))
    assert found.velocity_gain == pytest.approx(0.04, rel=1e-3)
    assert found.phase_crossover == pytest.approx(natural / (2.0 * np.pi), rel=2e-3)
    assert found.critical_gain == pytest.approx(2.0 * damping * natural / 0.04, rel=5e-3)
    a = 1.0 - 2.0 * damping**2
    assert found.velocity == pytest.approx(natural / (2.0 * np.pi) * np.sqrt(a + np.sqrt(a**2 + 1.0)), rel=2e-3)
    # The loop closed at half that gain is 3 dB down where its own closed form says.
    w = 2.0 * np.pi * found.position
    loop = damping * natural / (1j * w * ((1j * w) ** 2 / natural**2 + 2j * damping * w / natural + 1.0))
    assert abs(loop / (1.0 + loop)) == pytest.approx(np.sqrt(0.5), rel=2e-3)
    assert found.band() == pytest.approx((0.1 * found.position, 2.0 * found.position))


def test_the_benchs_bandwidth_lies_between_closed_form_and_valve() -> None:
    model = load_model(BENCH)
    found, closed = from_model(model), closed_form(model)
    assert found.velocity_gain == pytest.approx(closed.velocity_gain, rel=2e-3)
    # The valve's lag moves the phase crossover below the resonance, where the response is smaller.
    assert found.phase_crossover < closed.natural_frequency / (2.0 * np.pi)
    assert found.critical_gain > 2.0 * closed.damping * closed.natural_frequency / closed.velocity_gain
    assert 0.5 < found.position < 1.2 < found.phase_crossover < found.velocity


def test_a_response_that_does_not_reach_the_bandwidth_is_told() -> None:
    f, g = third_order(0.04, 100.0, 0.1)
    with pytest.raises(BandwidthError, match="does not pass −180°"):
        from_response(f[f < 10.0], g[f < 10.0])
    with pytest.raises(BandwidthError, match="measure to lower"):
        from_response(f[f > 5.0], g[f > 5.0])
    low = (f > 1e-2) & (f < 16.2)  # the crossover lies at 15.9 Hz
    found = from_response(f[low], g[low])
    assert np.isnan(found.velocity)  # which is no reason not to tell the other
    assert found.position == pytest.approx(from_response(f, g).position, rel=1e-3)


def record_of(natural: float, damping: float, noise: float) -> Record:
    """A probe on the third-order plant, simulated by its exact sampled model."""
    import control

    plan = load_plan("probe")
    drive = plan.open_loop
    plant = control.tf([0.04], [1.0 / natural**2, 2.0 * damping / natural, 1.0, 0.0])
    _, position = control.forced_response(plant.sample(1e-3, "zoh"), U=drive)
    position = position + noise * np.random.default_rng(1).standard_normal(drive.size)
    description = {"experiment": {"plan": plan.as_mapping()}}
    return Record.sampled("probe", 1e-3, {"drive": drive, "position": position}, description=description)


def test_a_probe_measures_the_bandwidth_through_the_noise_of_the_sensor() -> None:
    found, coherence = from_record(record_of(150.0, 0.2, 20e-6))
    expected = from_response(*third_order(0.04, 150.0, 0.2))
    assert found.position == pytest.approx(expected.position, rel=0.05)
    assert found.critical_gain == pytest.approx(expected.critical_gain, rel=0.05)
    assert found.velocity == pytest.approx(expected.velocity, rel=0.05)
    assert coherence.shape == found.frequency.shape


def test_a_probe_in_the_noise_is_refused() -> None:
    with pytest.raises(BandwidthError, match="stand out of the noise"):
        from_record(record_of(150.0, 0.2, 0.05))


def test_friction_damps_what_a_probe_sees() -> None:
    model = load_model(BENCH)
    found, _ = from_simulation(model, load_plan("probe"))
    assert found.critical_gain > 1.5 * from_model(model).critical_gain
    assert found.velocity_gain == pytest.approx(from_model(model).velocity_gain, rel=0.02)


def test_the_verb(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_verb("hydraulic_sysid", ["bandwidth", "--model", BENCH, "--out", str(tmp_path / "b")]) == 0
    document = json.loads((tmp_path / "b" / "bandwidth.json").read_text())
    assert document["position_bandwidth"] == pytest.approx(from_model(load_model(BENCH)).position)
    assert document["excitation_band"][1] == pytest.approx(2.0 * document["position_bandwidth"])
    assert_cannot_inject(document)
    assert "position, closed loop" in capsys.readouterr().out
    assert run_verb("hydraulic_sysid", ["bandwidth", "--out", str(tmp_path / "c")]) == 2
    assert "either a --model or a --record" in capsys.readouterr().err
