"""Figures of a response, against closed forms and the control library."""

from __future__ import annotations

import math

import control
import numpy as np
import pytest

from hydraulic_control.errors import ControlError
from hydraulic_control.response import Response, step_figures, tracking_figures


def second_order(damping: float, step: float, duration: float = 20.0) -> Response:
    time = np.arange(0.0, duration, 1e-3)
    _, y = control.step_response(control.tf([1.0], [1.0, 2.0 * damping, 1.0]), time)
    lead = np.zeros(100)
    reference = np.concatenate((lead, np.full(time.size, step)))
    return Response(1e-3 * np.arange(reference.size), reference, np.concatenate((lead, step * y)), reference)


@pytest.mark.parametrize("step", [0.05, -0.002])
@pytest.mark.parametrize("damping", [0.3, 0.7])
def test_the_figures_are_those_of_the_library(damping: float, step: float) -> None:
    ours = step_figures(second_order(damping, step))
    theirs = control.step_info(control.tf([1.0], [1.0, 2.0 * damping, 1.0]), T=np.arange(0.0, 20.0, 1e-3))
    assert ours.rise_time == pytest.approx(theirs["RiseTime"], abs=3e-3)
    assert ours.settling_time == pytest.approx(theirs["SettlingTime"], abs=3e-2)
    assert ours.overshoot == pytest.approx(100.0 * math.exp(-math.pi * damping / math.sqrt(1.0 - damping**2)), rel=1e-3)
    assert ours.steady_state_error < 1e-2 * abs(step)


def test_what_is_not_reached_is_infinite() -> None:
    response = second_order(0.1, 0.05, 5.0)
    assert step_figures(response).settling_time == math.inf
    low = Response(response.time, response.reference, 0.5 * response.reference, response.drive)
    assert step_figures(low).rise_time == math.inf


def test_a_reference_that_does_not_step_once_has_no_figures() -> None:
    time = np.arange(100) * 1e-3
    for reference in (np.zeros(100), np.sin(time)):
        with pytest.raises(ControlError, match="exactly one"):
            step_figures(Response(time, reference, reference, reference))


def test_tracking() -> None:
    time = np.arange(1000) * 1e-3
    figures = tracking_figures(Response(time, np.ones(1000), np.full(1000, 0.9), time))
    assert figures.rms_error == pytest.approx(0.1)
    assert figures.largest_error == pytest.approx(0.1)
    assert figures.activity == pytest.approx(1.0)


def test_documents() -> None:
    response = second_order(0.7, 0.05, 1.0)
    again = Response.from_document(response.as_document())
    assert again.position == pytest.approx(response.position)
    document = response.as_document()
    for broken in ({**document, "drive": document["drive"][1:]}, {**document, "time": "x"}, {"time": [1.0]}):
        with pytest.raises(ControlError):
            Response.from_document(broken)
