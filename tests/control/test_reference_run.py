"""A reference source that notices that nobody follows."""

from __future__ import annotations

import pytest

from hydraulic_control.reference_run import StandstillWatch
from hydraulic_interfaces.samples import PlantSample

MS = 1_000_000


@pytest.mark.parametrize(
    ("reference", "position", "drive", "notices"),
    [
        (0.1, 0.0, 0.0, True),
        (0.1, 0.0, 1e-6, False),
        (0.1, 0.099, 0.0, False),
        (None, 0.0, 0.0, False),
    ],
    ids=["stopped", "driven", "arrived", "nothing sent"],
)
def test_a_plant_that_stands_at_0_V_away_from_its_reference(
    reference: float | None, position: float, drive: float, notices: bool
) -> None:
    watch = StandstillWatch()
    found = [watch.stands(PlantSample(i * MS, position, drive=drive), reference) for i in range(200)]
    assert found == [notices and i >= 100 for i in range(200)]


def test_one_sample_with_a_drive_begins_the_patience_anew() -> None:
    watch = StandstillWatch()
    assert not any(watch.stands(PlantSample(i * MS, 0.0, drive=float(i % 90 == 0)), 0.1) for i in range(1000))
