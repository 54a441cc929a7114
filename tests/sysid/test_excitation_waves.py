"""The signals of a design: waves, binary sequences, and multisines with detection lines or a low crest factor."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import signal

from hydraulic_sysid.excitation import PlanError, signal_kinds
from hydraulic_sysid.excitation.crest import crest_factor
from hydraulic_sysid.excitation.signals.odd_random_phase_multisine import OddRandomPhaseMultisine
from hydraulic_sysid.excitation.signals.playback import Playback
from hydraulic_sysid.excitation.signals.prbs import Prbs
from hydraulic_sysid.excitation.signals.random_phase_multisine import RandomPhaseMultisine
from hydraulic_sysid.excitation.signals.sawtooth import Sawtooth
from hydraulic_sysid.excitation.signals.sine import Sine
from hydraulic_sysid.excitation.signals.square import Square
from hydraulic_sysid.excitation.signals.staircase import Staircase
from hydraulic_sysid.excitation.signals.steps import Steps

T = np.arange(10_000) / 1000.0
WAVES = [
    Sine(2.0, 0.7),
    Square(2.0, 0.7),
    Sawtooth(2.0, 0.7),
    Staircase(2.0, 0.1, 4),
    Prbs(2.0, 0.01, 6),
    Steps((2.0, -1.0), 0.3),
    OddRandomPhaseMultisine(0.5, 5.0, 0.2, 10.0),
    RandomPhaseMultisine(0.5, 5.0, 0.2, 10.0),
]


def test_waves_are_those_of_scipy() -> None:
    inside = T[1:]  # scipy puts the first sample of a square on its edge
    phase = 2.0 * np.pi * 0.7 * inside
    np.testing.assert_allclose(Sine(2.0, 0.7).sample(inside), 2.0 * np.sin(phase), atol=1e-12)
    np.testing.assert_array_equal(Square(2.0, 0.7).sample(inside), 2.0 * signal.square(phase + 1e-7))
    sawtooth = 2.0 * signal.sawtooth(phase + np.pi + 1e-7)
    np.testing.assert_allclose(Sawtooth(2.0, 0.7).sample(inside), sawtooth, atol=1e-6)


def test_a_square_shifted_by_a_quarter_moves_to_both_sides() -> None:
    drive = Square(1.0, 0.5, 0.25).sample(T)
    position = np.cumsum(drive) / 1000.0
    assert position.max() == pytest.approx(-position.min(), abs=2e-3)


def test_a_staircase_goes_up_down_and_back_in_equal_stairs() -> None:
    stairs = Staircase(3.0, 0.5, 3)
    np.testing.assert_allclose(stairs.levels(), [1, 2, 3, 2, 1, 0, -1, -2, -3, -2, -1, 0])
    assert stairs.length == pytest.approx(6.0)
    np.testing.assert_allclose(stairs.sample(np.array([0.0, 0.499, 0.5, 5.999, 6.0])), [1, 1, 2, 0, 1])


@pytest.mark.parametrize("order", [3, 6, 9])
def test_a_binary_sequence_has_two_levels_and_a_flat_spectrum(order: int) -> None:
    prbs = Prbs(1.5, 0.01, order, seed=5)
    assert set(prbs.bits) == {-1.5, 1.5}
    assert prbs.bits.size == 2**order - 1
    lines = np.abs(np.fft.fft(prbs.bits))[1:]
    np.testing.assert_allclose(lines, 1.5 * np.sqrt(2**order), rtol=1e-9)  # of a maximum-length sequence
    np.testing.assert_array_equal(prbs.sample(T + prbs.period), prbs.sample(T))


def test_an_inverse_repeat_turns_over_and_has_odd_lines_only() -> None:
    bits = Prbs(1.0, 0.01, 5, "yes").bits
    half = bits.size // 2
    np.testing.assert_array_equal(bits[half:], -bits[:half])
    assert np.abs(np.fft.rfft(bits))[::2].max() < 1e-9


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 1000), st.integers(0, 1000), st.integers(2, 6))
def test_detection_lines_are_left_out_of_every_group(seed: int, lines_seed: int, group: int) -> None:
    odd = OddRandomPhaseMultisine(0.7, 10.0, 0.1, 10.0, group, seed, lines_seed)
    left, played = odd.left_out(), odd.excited()
    assert np.all(played % 2 == 1) and np.all(left % 2 == 1)
    np.testing.assert_array_equal(np.sort(np.concatenate((left, played))), np.arange(1, 101, 2))
    assert left.size == 50 // group
    assert np.array_equal((left - 1) // 2 // group, np.arange(left.size))  # one of each group
    spectrum = 2.0 / T.size * np.abs(np.fft.rfft(odd.sample(T)))
    on = np.zeros(spectrum.size, dtype=bool)
    on[played] = True
    np.testing.assert_allclose(spectrum[on], 0.7 * np.sqrt(2.0 / played.size), rtol=1e-9)
    assert spectrum[~on].max() < 1e-9


def test_realisations_share_their_lines_and_differ_in_their_phases() -> None:
    one, two = (OddRandomPhaseMultisine(1.0, 10.0, 0.1, 10.0, seed=s, lines_seed=3) for s in (1, 2))
    np.testing.assert_array_equal(one.excited(), two.excited())
    assert np.abs(one.sample(T) - two.sample(T)).max() > 0.5
    other = OddRandomPhaseMultisine(1.0, 10.0, 0.1, 10.0, seed=1, lines_seed=4)
    assert not np.array_equal(one.excited(), other.excited())


@pytest.mark.parametrize("highest", [2.0, 20.0, 80.0])
def test_a_low_crest_factor_keeps_the_spectrum(highest: float) -> None:
    plain = RandomPhaseMultisine(1.0, 10.0, 0.1, highest, seed=4)
    low = RandomPhaseMultisine(1.0, 10.0, 0.1, highest, seed=4, crest="low")
    one, other = (np.abs(np.fft.rfft(x.sample(T))) for x in (plain, low))
    np.testing.assert_allclose(other, one, atol=1e-6 * one.max())
    assert crest_factor(plain.sample(T)) > 2.7
    assert crest_factor(low.sample(T)) < 1.6


def test_crest_factors_of_known_waves() -> None:
    assert crest_factor(Sine(3.0, 1.0).sample(T)) == pytest.approx(np.sqrt(2.0), rel=1e-3)
    assert crest_factor(Square(3.0, 1.0).sample(T)) == 1.0


@pytest.mark.parametrize("wave", WAVES, ids=lambda w: type(w).__name__)
def test_a_scaled_wave_is_so_many_times_as_large(wave) -> None:  # noqa: ANN001
    twice = wave.scaled(2.0)
    np.testing.assert_allclose(twice.sample(T), 2.0 * wave.sample(T), atol=1e-12)
    assert twice.size == pytest.approx(2.0 * wave.size)
    assert type(wave).label in signal_kinds()


def test_a_played_back_drive_is_scaled_by_its_gain(tmp_path) -> None:  # noqa: ANN001
    file = tmp_path / "drive.csv"
    file.write_text("time_s,drive_V\n0,1\n1,-3\n2,0\n")
    drive = Playback(str(file)).scaled(2.0)
    assert drive.gain == 2.0 and drive.size == 6.0
    with pytest.raises(PlanError, match="gain"):
        drive.scaled(2.0)


def test_a_wave_beyond_the_drive_is_refused() -> None:
    with pytest.raises(PlanError, match="amplitude"):
        Sine(8.0, 1.0).scaled(2.0)
    with pytest.raises(PlanError, match="3 odd multiples"):
        OddRandomPhaseMultisine(1.0, 1.0, 1.0, 3.0)
