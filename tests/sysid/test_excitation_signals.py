"""Signals: bounds, shapes and spectra as stated, whatever the parameters."""

from __future__ import annotations

import gzip
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hydraulic_sysid.excitation import PlanError, PlaybackError, signal_kinds
from hydraulic_sysid.excitation.signals.chirp import Chirp
from hydraulic_sysid.excitation.signals.multisine import Multisine
from hydraulic_sysid.excitation.signals.playback import Playback
from hydraulic_sysid.excitation.signals.random_phase_multisine import RandomPhaseMultisine
from hydraulic_sysid.excitation.signals.steps import Steps
from hydraulic_sysid.excitation.signals.triangle import Triangle

AMPLITUDE = st.floats(0.01, 10.0)
FREQUENCY = st.floats(0.05, 200.0)
TIMES = np.arange(5000) / 1000.0

CHIRPS = st.builds(
    Chirp,
    amplitude=AMPLITUDE,
    frequency_start=FREQUENCY,
    frequency_end=FREQUENCY,
    sweep_time=st.floats(0.5, 50.0),
    law=st.sampled_from(("linear", "exponential")),
    phase=st.floats(-math.pi, math.pi),
)


def test_the_folder_is_the_list():
    assert set(signal_kinds()) == {
        "chirp", "multisine", "odd_random_phase_multisine", "playback", "prbs", "random_phase_multisine", "sawtooth",
        "sine", "square", "staircase", "steps", "triangle"
    }  # fmt: skip
    assert signal_kinds()["chirp"] is Chirp


@settings(deadline=None)
@given(CHIRPS)
def test_chirp_is_bounded_and_has_the_stated_frequency(chirp):
    assert np.abs(chirp.sample(TIMES)).max() <= chirp.amplitude
    # the phase between two close instants of one sweep grows by 2π times the mean instantaneous frequency
    t = np.linspace(0.0, 0.999 * chirp.sweep_time, 50)
    h = 1e-4 / max(chirp.highest_frequency, 1.0)
    quarter = (
        Chirp(**{**chirp.as_mapping(), "phase": 0.0}),
        Chirp(**{**chirp.as_mapping(), "phase": math.pi / 2}),
    )

    def angle(at):
        return np.arctan2(quarter[0].sample(at), quarter[1].sample(at))

    step = np.mod(angle(t + h) - angle(t) + np.pi, 2 * np.pi) - np.pi
    np.testing.assert_allclose(step / (2 * np.pi * h), chirp.frequency(t + h / 2), rtol=1e-5)


@settings(deadline=None)
@given(CHIRPS)
def test_chirp_frequency_runs_from_start_to_end(chirp):
    ends = chirp.frequency(np.array([0.0, chirp.sweep_time * (1 - 1e-12)]))
    np.testing.assert_allclose(ends, [chirp.frequency_start, chirp.frequency_end], rtol=1e-6)
    middle = chirp.frequency(np.array(chirp.sweep_time / 2))
    both = chirp.frequency_start, chirp.frequency_end
    mean = math.sqrt(both[0] * both[1]) if chirp.law == "exponential" else sum(both) / 2
    assert middle == pytest.approx(mean)


def test_chirp_starts_over_after_a_sweep():
    chirp = Chirp(amplitude=2.0, frequency_start=1.0, frequency_end=9.0, sweep_time=2.0)
    t = np.arange(1000) / 1000.0
    np.testing.assert_allclose(chirp.sample(t + 2.0), chirp.sample(t), atol=1e-9)


@pytest.mark.parametrize("phases", ["zero", "schroeder", "random"])
def test_multisine_has_its_tones_and_nothing_else(phases):
    bandwidth = 20.0
    tones = Multisine([0.1 * bandwidth, 0.5 * bandwidth, 2 * bandwidth], [1.0, 2.0, 0.5], phases, seed=3)
    spectrum = np.abs(np.fft.rfft(tones.sample(TIMES))) * 2 / TIMES.size
    expected = np.zeros(spectrum.size)
    expected[[10, 50, 200]] = 1.0, 2.0, 0.5  # lines of 0.2 Hz
    np.testing.assert_allclose(spectrum, expected, atol=1e-9)


def test_multisine_of_the_paper_is_a_sum_of_sines_from_zero():
    tones = Multisine([0.4, 2.0, 8.0], 1.5)
    expected = 1.5 * sum(np.sin(2 * np.pi * f * TIMES) for f in (0.4, 2.0, 8.0))
    np.testing.assert_allclose(tones.sample(TIMES), expected, atol=1e-12)


def test_schroeder_phases_lower_the_peak():
    lines = [k / 5 for k in range(1, 31)]
    peaks = {p: np.abs(Multisine(lines, 1.0, p).sample(TIMES)).max() for p in ("zero", "schroeder")}
    assert peaks["schroeder"] < 0.5 * peaks["zero"]


@settings(deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(0.1, 3.0))
def test_random_phase_multisine_is_flat_in_its_band_and_periodic(seed, rms):
    signal = RandomPhaseMultisine(rms=rms, period=5.0, frequency_min=0.4, frequency_max=12.0, seed=seed)
    drive = signal.sample(TIMES)
    spectrum = np.abs(np.fft.rfft(drive)) * 2 / TIMES.size
    inside = np.zeros(spectrum.size, bool)
    inside[2:61] = True
    np.testing.assert_allclose(spectrum[inside], rms * math.sqrt(2 / 59), rtol=1e-9)
    assert spectrum[~inside].max() < 1e-9
    assert np.sqrt(np.mean(drive**2)) == pytest.approx(rms)
    np.testing.assert_allclose(signal.sample(TIMES + 5.0), drive, atol=1e-9)


def test_random_phases_follow_the_seed():
    def drive(seed):
        return RandomPhaseMultisine(1.0, 5.0, 0.4, 12.0, seed).sample(TIMES)

    np.testing.assert_array_equal(drive(1), drive(1))
    assert np.abs(drive(1) - drive(2)).max() > 0.5
    # drawn once, on another machine: what a seed stands for must never change
    assert drive(1)[0] == pytest.approx(-0.5916282734616882, rel=1e-12)


@settings(deadline=None)
@given(AMPLITUDE, st.floats(0.1, 50.0))
def test_triangle_rises_from_zero_to_its_peaks(amplitude, frequency):
    triangle = Triangle(amplitude, frequency)
    quarters = np.arange(9) / (4 * frequency)
    expected = amplitude * np.array([0, 1, 0, -1, 0, 1, 0, -1, 0])
    np.testing.assert_allclose(triangle.sample(quarters), expected, atol=1e-9 * amplitude)
    assert np.abs(triangle.sample(TIMES)).max() <= amplitude
    slope = np.diff(triangle.sample(np.linspace(0, 0.9999 / (4 * frequency), 10)))
    np.testing.assert_allclose(slope, slope[0], rtol=1e-6)


@settings(deadline=None)
@given(st.lists(st.floats(-10, 10), min_size=1, max_size=8), st.integers(2, 700))
def test_steps_hold_each_level_for_the_same_number_of_samples(levels, samples):
    steps = Steps(levels, samples / 1000.0)
    expected = np.resize(np.repeat(levels, samples), TIMES.size)
    np.testing.assert_array_equal(steps.sample(TIMES), expected)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Chirp(12.0, 1.0, 2.0, 3.0), ["chirp", "amplitude", "12.0", "up to 10 V"]),
        (lambda: Chirp(1.0, 0.0, 2.0, 3.0), ["frequency_start", "0.0", "above 0", "Hz"]),
        (lambda: Chirp(1.0, 1.0, math.nan, 3.0), ["frequency_end", "nan"]),
        (lambda: Chirp(1.0, 1.0, 2.0, 3.0, "quadratic"), ["law", "quadratic", "exponential | linear"]),
        (lambda: Multisine([], 1.0), ["multisine", "frequencies", "one or a list"]),
        (lambda: Multisine([1.0, 2.0, 3.0], [1.0, 2.0]), ["amplitudes", "as many", "(3)"]),
        (lambda: Multisine([1.0, 1.0], 1.0), ["frequencies", "once"]),
        (lambda: Multisine([1.0], 1.0, "random", 1.5), ["seed", "1.5", "whole number"]),
        (lambda: RandomPhaseMultisine(1.0, 1.0, 2.2, 2.8), ["frequency_max", "1/period = 1 Hz"]),
        (lambda: Triangle(True, 1.0), ["triangle", "amplitude", "True"]),
        (lambda: Steps([1.0, 11.0], 0.5), ["steps", "levels", "11.0", "from -10 up to 10 V"]),
    ],
)
def test_a_bad_parameter_is_named_with_value_and_range(make, words):
    with pytest.raises(PlanError) as raised:
        make()
    for word in words:
        assert word in str(raised.value)


def test_quantities_may_carry_their_unit():
    chirp = Chirp("500 mV", "2 Hz", "1e1", "1 min", phase="90 deg")
    assert chirp == Chirp(0.5, 2.0, 10.0, 60.0, phase=math.pi / 2)
    with pytest.raises(PlanError, match="amplitude = '3 m'"):
        Chirp("3 m", 1.0, 2.0, 3.0)


def test_playback_holds_each_value_until_the_next(tmp_path):
    file = tmp_path / "drive.csv"
    file.write_text("time_s,position_m,drive_V\n10.0,0,1.0\n10.5,0,-2.0\n11.5,0,3.0\n12.5,0,0.5\n")
    signal = Playback(file)
    t = np.array([0.0, 0.499, 0.5, 1.499, 1.5, 2.5, 3.499, 3.5, 9.0])
    np.testing.assert_array_equal(signal.sample(t), [1.0, 1.0, -2.0, -2.0, 3.0, 0.5, 0.5, 0.0, 0.0])
    assert signal.length == pytest.approx(3.5)
    np.testing.assert_array_equal(Playback(file, gain=-2.0).sample(t[:3]), [-2.0, -2.0, 4.0])


def test_playback_gives_every_sample_of_a_regular_file_back(tmp_path):
    drive = np.round(np.random.default_rng(1).uniform(-5, 5, 3000), 6)
    file = tmp_path / "drive.csv.gz"
    with gzip.open(file, "wt") as stream:
        stream.writelines(f"{k / 1000:.6f},{u:.6f}\n" for k, u in enumerate(drive))
    np.testing.assert_array_equal(Playback(file).sample(np.arange(3000) / 1000.0), drive)


def test_playback_knows_the_content_it_was_planned_with(tmp_path):
    file = tmp_path / "drive.csv"
    file.write_text("0,1\n1,2\n")
    planned = Playback(file).as_mapping()
    assert Playback(**planned) == Playback(file)
    file.write_text("0,1\n1,3\n")
    with pytest.raises(PlanError, match="sha256"):
        Playback(**planned)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("time_s,drive_V\n0,1\n1,x\n", ["row 3", "drive_V", "'x'"]),
        ("time_s,drive_V\n0,1\n1,nan\n", ["row 3", "drive_V", "nan is not a finite number"]),
        ("time_s,drive_V\n0,1\n0,2\n", ["row 3", "time_s", "does not come after"]),
        ("time_s,drive_V\n0,1\n1\n", ["row 3", "1 cells", "2 cells"]),
        ("time_ms,drive_V\n0,1\n1,2\n", ["time_ms", "needed: time_s"]),
        ("0,1,2\n1,2,3\n", ["3 columns and no header"]),
        ("time_s,drive_V\n0,1\n", ["1 rows"]),
        ("", ["the file is empty"]),
    ],
)
def test_a_bad_playback_file_is_named_with_row_and_column(tmp_path, content, words):
    file = tmp_path / "drive.csv"
    file.write_text(content)
    with pytest.raises(PlaybackError) as raised:
        Playback(file)
    for word in [str(file), *words]:
        assert word in str(raised.value)


def test_playback_refuses_bad_files_and_drives_that_are_too_large(tmp_path):
    with pytest.raises(PlaybackError, match="cannot be read"):
        Playback(tmp_path / "absent.csv")
    broken = tmp_path / "broken.csv.gz"
    broken.write_bytes(b"not gzip")
    with pytest.raises(PlaybackError, match="no gzip file"):
        Playback(broken)
    file = tmp_path / "drive.csv"
    file.write_text("0,6\n1,2\n")
    for gain in (2.0, -2.0):
        with pytest.raises(PlanError, match=f"gain = {gain}"):
            Playback(file, gain=gain)
