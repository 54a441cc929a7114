"""The parts of locating: thinning, whitening, curves, common lines, bounded cross-validated fits, and the verb."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from hostile_page import assert_cannot_inject
from scipy.optimize import lsq_linear

from hydraulic_sysid.diagnosis.locate.attribution import PARAMETERS, attribute
from hydraulic_sysid.diagnosis.locate.basis import hat_functions, play, rate_limited, signed_knots
from hydraulic_sysid.diagnosis.locate.normal_equations import FOLDS, NormalEquations
from hydraulic_sysid.diagnosis.locate.spectral_lines import common_lines, waves
from hydraulic_sysid.diagnosis.locate.whitening import ORDER, Whitener, decimate
from hydraulic_sysid.verbs.locate import main

EXAMPLES = Path(__file__).resolve().parents[2] / "examples" / "sample_bench"


def test_thinning_keeps_a_slow_signal_and_takes_the_noise_down() -> None:
    t = np.arange(5000) * 1e-3
    kept = decimate(np.sin(2 * np.pi * t), 5)
    assert kept == pytest.approx(np.sin(2 * np.pi * t[6 : 6 + 5 * kept.size : 5]), abs=1e-3)
    noise = np.random.default_rng(0).standard_normal((3, 50_000))
    assert decimate(noise, 5).std(axis=1) == pytest.approx(np.full(3, np.sqrt(0.11)), rel=0.03)
    assert decimate(noise, 1) is noise


def test_whitened_fresh_noise_is_white_with_variance_one() -> None:
    def coloured(seed: int) -> np.ndarray:
        e = np.random.default_rng(seed).standard_normal((2, 20_002))
        first = e[0, 2:] - 0.8 * e[0, 1:-1]
        return np.stack([5.0 * first, 1e-3 * (0.5 * first + e[1, 2:])])

    whitener = Whitener.of(coloured(0))
    white = whitener(coloured(1))
    assert white.shape == (2, 20_000 - ORDER)
    assert np.cov(white) == pytest.approx(np.eye(2), abs=0.05)
    for lag in (1, 2, 5):
        assert np.abs(white[:, lag:] @ white[:, :-lag].T / white.shape[1]).max() < 0.05


def test_whitening_some_balances_is_whitening_all_with_the_others_zero() -> None:
    rng = np.random.default_rng(2)
    whitener = Whitener.of(rng.standard_normal((3, 3000)))
    part = rng.standard_normal((4, 1, 500))
    every = np.zeros((4, 3, 500))
    every[:, 1:2] = part
    assert whitener(part, (1,)) == pytest.approx(whitener(every))


def test_tents_make_any_piecewise_linear_curve() -> None:
    x = np.random.default_rng(3).uniform(-2.0, 2.0, 500)
    knots = signed_knots(x, 5)
    assert knots.size == 11 and knots[5] == 0.0 and np.all(np.diff(knots) > 0.0)
    basis = hat_functions(x, knots)
    assert basis.sum(axis=0) == pytest.approx(np.ones(500))
    inside = np.abs(x) < knots[-1]
    assert (knots @ basis)[inside] == pytest.approx(x[inside])


def test_play_and_rate_limit_follow_their_definitions() -> None:
    x = np.concatenate((np.linspace(0.0, 1.0, 101), np.linspace(1.0, 0.0, 101)))
    held = play(x, 0.1)
    assert held[100] == pytest.approx(0.9) and held[110] == pytest.approx(0.9) and held[-1] == pytest.approx(0.1)
    step = rate_limited(np.concatenate((np.zeros(5), np.ones(20))), 0.1)
    assert step[5:15] == pytest.approx(np.arange(1, 11) * 0.1) and step[-1] == 1.0


def test_a_line_common_to_records_is_found_but_not_the_excitations() -> None:
    rng = np.random.default_rng(4)
    t = np.arange(4000) / 200.0
    records = [rng.standard_normal((2, t.size)) for _ in range(4)]
    assert common_lines(records, 200.0) == []
    for i, r in enumerate(records):
        r[0] += 0.5 * np.sin(2 * np.pi * 23.4 * t + i)
    records[0][1] += 3.0 * np.sin(2 * np.pi * 5.0 * t)
    assert common_lines(records, 200.0) == pytest.approx([23.4], abs=0.02)
    both = waves([23.4], t, 1, 4)
    assert both.shape == (8, t.size) and not both[:2].any() and both[2:4].any() and not both[4:].any()


def _moments(seed: int, coefficients: np.ndarray, size: int) -> tuple[NormalEquations, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    x = rng.standard_normal((coefficients.size, 1, size))
    y = coefficients @ x[:, 0] + rng.standard_normal(size)
    return NormalEquations.of(x, y[None], 200.0), x[:, 0], y


def test_what_is_left_on_other_folds_is_the_noise_and_bounds_bind() -> None:
    truth = np.array([0.6, 0.0, 2.0])
    moments, x, y = _moments(5, truth, 8000)
    assert moments.count.sum() == 8000 and len(moments.count) == FOLDS
    none = np.zeros(0, dtype=np.int64)
    wide = moments.left(none, np.array([1, 2]), np.array([-9.0]), np.array([9.0]))
    assert wide / 8000 == pytest.approx(1.0, abs=0.05)
    bound = moments.left(np.array([1]), np.array([2]), np.array([-0.1]), np.array([0.1]))
    solution = lsq_linear(x.T, y, bounds=([-0.1, -np.inf, -np.inf], [0.1, np.inf, np.inf])).x
    assert solution[0] == pytest.approx(0.1)
    assert bound == pytest.approx(float(np.sum((y - solution @ x) ** 2)), rel=0.01)


def test_ranking_takes_the_cause_first_and_gives_a_stand_in_nothing() -> None:
    rng = np.random.default_rng(6)
    cause, other = rng.standard_normal((2, 8000))
    proxy = 0.9 * cause + 0.45 * rng.standard_normal(8000)
    x = np.stack([rng.standard_normal(8000), cause, proxy, other])[:, None]
    y = (2.0 * cause + 0.5 * other + rng.standard_normal(8000))[None]
    reference = NormalEquations.of(x, rng.standard_normal((1, 8000)), 200.0)
    names = [PARAMETERS, "valve", "sensor", "force"]
    verdict = attribute(
        NormalEquations.of(x, y, 200.0), reference, names, ["", "opening", "lag", "velocity"], [(-1.0, 1.0)]
    )
    share = {b.subsystem: b.share for b in verdict.ranked}
    assert [b.subsystem for b in verdict.ranked][:2] == ["valve", "force"]
    assert share["valve"] > 0.9 and share["force"] == pytest.approx(0.25 / 4.25, abs=0.02) and share["sensor"] == 0.0
    assert verdict.left == pytest.approx(1.0, abs=0.05)
    assert next(b for b in verdict.ranked if b.subsystem == "sensor").alone > 0.6


def test_where_the_model_leaves_no_more_than_an_exact_one_there_is_nothing_to_share() -> None:
    rng = np.random.default_rng(7)
    x = rng.standard_normal((2, 1, 8000))
    exact = NormalEquations.of(x, rng.standard_normal((1, 8000)), 200.0)
    # Less is left than of the exact model, and a little of that goes with the valve.
    y = 0.9 * rng.standard_normal((1, 8000)) + 0.2 * x[1]
    verdict = attribute(NormalEquations.of(x, y, 200.0), exact, [PARAMETERS, "valve"], ["", "opening"], [(-1.0, 1.0)])
    assert verdict.refitted < verdict.exact
    assert [(b.share, b.alone) for b in verdict.ranked] == [(0.0, 0.0)]


def test_verb_writes_document_and_page(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    record = str(EXAMPLES / "steps.csv.gz")
    call = ["--model", "sample_bench", "--record", record, "--window", "0", "8", "--out", str(tmp_path)]
    assert main(call) == 0
    told = capsys.readouterr().out
    assert "valve" in told and "Force balance" in told
    document = json.loads((tmp_path / "locate.json").read_text())
    assert document["schema"] == "hydraulic_sysid.locate/2"
    assert document["attribution"][0]["name"] == "valve"
    page = (tmp_path / "report.html").read_text()
    assert document["verdict"]["text"] in page and "Which balance is violated" in page
    assert_cannot_inject(document)
    assert main([*call, "--json"]) == 0
    shown = json.loads(capsys.readouterr().out)
    assert shown["verdict"] == document["verdict"] and "error_maps" not in shown["balances"][0]


def test_verb_names_what_it_cannot_use(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--model", "nobody", "--record", str(EXAMPLES / "steps.csv.gz"), "--out", str(tmp_path)]) == 2
    assert "nobody" in capsys.readouterr().err
