"""The half of the demo that needs no graph: identify, compare, diagnose, and one page for all."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hydraulic_sim.errors import SimulationError
from hydraulic_sim.model import Model
from hydraulic_sim.model_file import save_model
from hydraulic_sysid.data import results
from hydraulic_sysid.data.records import Record, RecordError, TimeError, read_records
from hydraulic_sysid.diagnosis.compare import ComparisonError, ModelSubject, compare
from hydraulic_sysid.diagnosis.search import DiagnosisError, diagnose
from hydraulic_sysid.linear import identification
from hydraulic_sysid.linear.models import IdentificationError
from hydraulic_sysid.report import write_page

from .errors import DemoError
from .online import Steps

MODEL = "model.yaml"
"""The model with what was missing, in the folder of the run."""
MOST_MISSING = {"sim": 0.01, "can": 0.05}
"""Share of a bag's samples that the demo interpolates without giving up, of a plant that follows the wall clock.

A cycle that is missed on the bus is lost, where the simulator makes up for it.
"""


@dataclass(frozen=True)
class Analysis:
    """The result documents (None where one could not be made, with the reason) and the page."""

    identified: dict[str, Any] | None
    compared: dict[str, Any]
    diagnosed: dict[str, Any]
    page: Path
    left_out: str = ""


def read_bag(bag: Path, steps: Steps, most: float) -> list[Record]:
    """Records of a bag that was just made.

    Without lockstep samples are missing where the machine held the plant or the recorder up. A few are interpolated,
    and the user is told; a record of the user's own is not treated so, since there a gap may mean something.

    :raises DemoError: more than the share ``most`` of the samples is missing, or the bag is no record.
    """
    try:
        return read_records(bag)
    except TimeError as error:
        problem = error.problem
    except RecordError as error:
        raise DemoError("read the bag", str(error)) from None
    try:
        even, pieces = read_records(bag, "resample"), read_records(bag, "split")
    except RecordError as error:
        raise DemoError("read the bag", str(error)) from None
    missing = sum(map(len, even)) - sum(map(len, pieces))
    share = f"{missing} of {sum(map(len, even))} samples of {bag.name} are missing"
    if missing > most * sum(map(len, even)):
        raise DemoError("read the bag", f"{share} (first: {problem})", "is the machine busy? Try again, or --quick")
    steps.say(f"{share}: interpolated")
    return even


def analyse(
    records: list[Record], test_records: list[Record], model: Model, out: Path, steps: Steps, quick: bool = False
) -> Analysis:
    """Identify on ``records`` (tested on ``test_records`` or the last fifth); compare the model with all of them.

    Then say what the model lacks, by a ``quick`` diagnosis or a full one, and write the model that has it.

    :raises DemoError: a step failed.
    """
    steps.begin("identify", 2.0)
    identified, left_out = None, ""
    try:
        # A record sampled more slowly than usual is identified at its own sampling time.
        sampling = max(identification.IdentificationSettings().sampling_time, *(r.dt for r in records))
        settings = identification.IdentificationSettings(sampling_time=sampling)
        identified, _ = identification.identify(records, test_records or None, settings)
        results.write_result(out, identified)
    except IdentificationError as error:
        left_out = f"not identified: {error}"
    steps.done()
    every = [*records, *test_records]
    steps.begin("compare", 3.0 + 2.0 * len(every))
    try:
        compared = compare(ModelSubject(model), every, progress=lambda _: steps.tick())
    except ComparisonError as error:
        raise DemoError("compare", str(error), "give records with drive and position that are long enough") from None
    results.write_result(out, compared)
    steps.done()
    steps.begin("diagnose", 5.0 if quick else 10.0 + 5.0 * len(every))
    try:
        diagnosis = diagnose(model, every, progress=lambda _: steps.tick(), quick=quick)
    except (DiagnosisError, SimulationError) as error:
        raise DemoError("diagnose", str(error), "give records with drive and position that are long enough") from None
    results.write_result(out, diagnosis.result)
    save_model(diagnosis.model, out / MODEL)
    steps.done()
    steps.begin("report", 2.0)
    page = write_page(out, results.read_folder(out))
    steps.done()
    return Analysis(identified, compared, diagnosis.result, page, left_out)
