"""What the excitation tells of a run is what the recorder understands: both use the contract's names."""

from __future__ import annotations

import inspect
import json
from types import ModuleType

import pytest

from hydraulic_interfaces.contract import ABORTED, FINISHED, STARTED
from hydraulic_sysid.data.bag import experiment
from hydraulic_sysid.data.bag.types import typestore
from hydraulic_sysid.excitation import Plan, session
from hydraulic_sysid.excitation.run import ExcitationRun
from hydraulic_sysid.excitation.signals.steps import Steps

PLAN = Plan("any", Steps([2.0], 1.0), 0.3)


@pytest.mark.parametrize("end", [FINISHED, ABORTED])
def test_the_recorder_understands_the_events_of_a_run(end: str) -> None:
    kind_of_text, store = "std_msgs/msg/String", typestore()
    log, run = experiment.ExperimentLog(), ExcitationRun(PLAN)
    for kind, stamp in ((STARTED, 10), (end, 20)):
        assert not log.ended
        message = store.types[kind_of_text](session.experiment_event(kind, run, 10, stamp))
        log.take(bytes(store.serialize_cdr(message, kind_of_text)))
    assert (log.ended, log.outcome, log.end_ns) == (True, end, 20)
    assert [json.loads(text)["event"] for text in log.custom_data().values()] == [STARTED, end]


@pytest.mark.parametrize("module", [experiment, session])
def test_the_names_stand_in_the_contract_alone(module: ModuleType) -> None:
    source = inspect.getsource(module)
    assert [name for name in (STARTED, FINISHED, ABORTED) if f'"{name}"' in source] == []
