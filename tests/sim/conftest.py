"""Plants that the tests of the physics share, and the tools to look into them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import pytest

from hydraulic_sim import registry
from hydraulic_sim.effect import Effect
from hydraulic_sim.model import Model
from hydraulic_sim.model_file import load_model
from hydraulic_sim.plant import Plant

Array = np.ndarray


@pytest.fixture(scope="session")
def bare() -> Model:
    """The bench of the samples with no effect on but the end stops."""
    model = load_model("sample_bench")
    for name in model.effects:
        model = model.without_effect(name)
    return model


@pytest.fixture(scope="session")
def everything(bare: Model) -> Model:
    """The same with every effect on that a diagnosis may find on it, at the library's defaults."""
    for name, effect in registry.library().items():
        if not effect.always_on and effect.searched and bare.kind in effect.kinds:
            bare = bare.with_effect(name)
    return bare


@pytest.fixture(scope="session")
def with_effect(bare: Model) -> Callable[[Effect], Model]:
    """The bare bench with one effect on (the end stops always are)."""

    def build(effect: Effect) -> Model:
        return bare if effect.always_on else bare.with_effect(effect.name)

    return build


@pytest.fixture(scope="session")
def random_states() -> Callable[..., Iterator[tuple[Array, float]]]:
    """`random_states(plant, seed, count)`: states far beyond what a plant reaches, and drives [V]."""

    def draw(plant: Plant, seed: int, count: int) -> Iterator[tuple[Array, float]]:
        generator = np.random.default_rng(seed)
        scales = np.array([record.scale for record in plant.layout.state_records.values()])
        half = 0.5 * plant.value("stroke")
        special_positions = (0.0, half, -half, half + 1e-5, -half - 1e-5)
        special_velocities = (0.0, 1e-9, -1e-9, 1e-3, -1e-3, 50.0, -50.0)
        special_pressures = (0.0, -1e6, -1e9, 1e9, 14e6, 101325.0)
        for _ in range(count):
            x = scales * generator.standard_normal(len(scales)) * 10.0 ** generator.uniform(-2.0, 1.0, len(scales))
            x[0] = generator.choice(special_positions) if generator.random() < 0.4 else generator.uniform(-0.8, 0.8)
            x[1] = generator.choice(special_velocities) if generator.random() < 0.4 else generator.normal(0.0, 0.3)
            for i in (2, 3):
                x[i] = generator.uniform(0.0, 14e6)
                if generator.random() < 0.3:
                    x[i] = generator.choice(special_pressures)
            x[plant.layout.states["stick"]] = generator.uniform(-1.0, 1.0)
            yield x, float(generator.choice((0.0, 10.0, -10.0, generator.uniform(-10.0, 10.0))))

    return draw


@pytest.fixture
def small_library(monkeypatch: pytest.MonkeyPatch, bare: Model) -> Model:
    """A library of the end stops alone, which compiles in seconds; returns a model that fits it."""
    full = registry.library()
    small = registry.Library([full.file("end_stop")])
    monkeypatch.setattr(registry, "_BUILTIN", [small])
    return replace(bare, entries={k: entry for k, entry in bare.entries.items() if "." not in k}, document=None)
