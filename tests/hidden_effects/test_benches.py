"""The catalogue: complete, independent of the project, visible in the records, and honest to the user."""

from __future__ import annotations

import ast
from pathlib import Path

import numpy as np
import pytest

from hidden_effects import benches, catalogue, experiments, plant
from hydraulic_sim.model_file import load_model
from hydraulic_sim.registry import library

PLANT = Path(benches.__file__).parent
INDEPENDENT = ("axis", "parameters", "laws", "solver", "experiments", "plant", "catalogue", "benches", "geometry",
               "motion", "sensors", "settings", "family")  # fmt: skip
LEFT_OUT = {"viscous_friction", "coulomb_friction", "internal_leakage"}  # hidden by leaving them out of the model file
SHOWN_IN = ("steps", "fast", "long")
NOISE = {"position_m": plant.POSITION_NOISE, "pressure_a_Pa": plant.PRESSURE_NOISE,
         "pressure_b_Pa": plant.PRESSURE_NOISE}  # fmt: skip


@pytest.mark.parametrize("module", INDEPENDENT)
def test_the_plant_imports_nothing_of_the_project(module):
    tree = ast.parse((PLANT / f"{module}.py").read_text())
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names = [a.name for a in node.names]
        elif isinstance(node, ast.ImportFrom):
            names = [] if node.level else [node.module or ""]
        else:
            continue
        assert not [n for n in names if n.startswith("hydraulic")], names


def test_every_library_effect_is_hidden_and_compared_by_its_parameters():
    every = library(())
    # The benches are hydraulic: what acts in other plants alone is nothing that a diagnosis could find there.
    found = {name for name, e in every.items() if "hydraulic" in e.kinds and e.searched and not e.always_on}
    assert set(catalogue.LIBRARY) == found
    assert not set(catalogue.UNKNOWN) & found
    for hidden in catalogue.LIBRARY.values():
        assert hidden.truth
        assert set(hidden.truth.values()) <= {p.name for p in every[hidden.name].parameters}
        assert set(hidden.companions) <= set(every)
    for pair in catalogue.PAIRS:
        assert set(pair) <= set(catalogue.LIBRARY)


def test_names_are_unique_and_counts_suffice():
    every = benches.every()
    assert len({b.name for b in every}) == len(every)
    kinds = [b.kind for b in every]
    assert kinds.count("none") >= 10 and kinds.count("pair") >= 20 and kinds.count("unknown") >= 2 * 12
    assert kinds.count("single") == 2 * len(catalogue.LIBRARY)
    assert kinds.count("datum") == 2 * len(catalogue.DATUM) and kinds.count("recording") == 2 * len(catalogue.RECORDING)


@pytest.mark.thorough
@pytest.mark.parametrize("name", sorted(set(catalogue.LIBRARY | catalogue.UNKNOWN | catalogue.DATUM) - LEFT_OUT))
def test_what_is_mild_moves_a_channel_by_several_times_the_noise(name):
    kind = next(kind for kind, names in catalogue.KINDS.items() if name in names)
    bench = benches.Bench(kind, (name,), "mild", 1)
    moved = 0.0
    with_it = benches.make(bench, noise=False, names=SHOWN_IN)
    without = benches.make(bench, noise=False, names=SHOWN_IN, without=(name,))
    for record in SHOWN_IN:
        for column, noise in NOISE.items():
            moved = max(moved, np.abs(with_it[record][column] - without[record][column]).max() / noise)
    assert moved > 3.0


@pytest.mark.parametrize(
    "bench",
    [
        benches.Bench("none", seed=1),
        benches.Bench("single", ("coulomb_friction",), "strong", 1),
        benches.Bench("single", ("viscosity_drift",), "mild", 1),
        benches.Bench("pair", ("load_spring", "internal_leakage"), "strong", 1),
    ],
    ids=lambda b: b.name,
)
def test_the_users_model_is_the_data_sheet_without_what_is_hidden(bench, tmp_path):
    path = tmp_path / "model.yaml"
    path.write_text(benches.model_text(bench))
    model = load_model(path)
    assert set(model.effects) | {"end_stop"} == set(bench.known())
    assert not set(bench.effects) & set(model.effects)
    assert model.value("moving_mass") == bench.sheet()["mass"]
    built = bench.plain()
    for key in benches.SCATTERED:
        assert 0.95 <= built[key] / bench.sheet()[key] <= 1.05
    if "viscous_friction" in model.effects:
        assert model.value("viscous_friction.coefficient") == bench.sheet()["viscous"]


def test_a_bench_is_reproducible_and_a_new_measurement_differs():
    bench = benches.Bench("single", ("valve_deadband",), "mild", 3)
    one, two = (benches.make(bench, names=("steps",))["steps"] for _ in range(2))
    assert all(np.array_equal(one[c], two[c]) for c in plant.COLUMNS)
    new = benches.make(bench, names=("steps",), draw=" fresh")["steps"]
    assert not np.array_equal(new["command_V"], one["command_V"])
    assert bench.values() == benches.Bench("single", ("valve_deadband",), "mild", 3).values()
    assert benches.Bench("single", ("valve_deadband",), "mild", 4).values() != bench.values()


def test_the_first_bench_is_the_one_of_earlier_figures():
    """To the last digit: geometry and sensors that came later have not touched it."""
    known = {
        benches.Bench("none", seed=1): (4.5197, -0.03168, 7181728.0, 7107280.0),
        benches.Bench("single", ("return_back_pressure",), "strong", 1): (7.9417, 0.057816, 7813807.0, 7724118.0),
    }
    for bench, row in known.items():
        table = benches.make(bench, names=("fast",))["fast"]
        assert [table[c][3000] for c in plant.COLUMNS[1:]] == pytest.approx(row, rel=1e-9)


def test_written_records_hold_the_columns(tmp_path):
    bench = benches.Bench("none", seed=2)
    paths = benches.write_records(benches.make(bench, names=("chirp",)), tmp_path)
    table = np.loadtxt(paths[0], delimiter=",", skiprows=1)
    assert table.shape == (experiments.times().size, len(plant.COLUMNS))
    assert table[-1, 0] == pytest.approx(19.999)
