"""What the estimator publishes about the running estimate, as messages of the contract."""

from __future__ import annotations

from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from hydraulic_interfaces.contract import ESTIMATOR_NODE
from hydraulic_interfaces.conversions import to_time
from hydraulic_node_utils.nodes import diagnostics
from hydraulic_sysid.linear.models.recursive_arx import RecursiveArx, Step
from hydraulic_sysid.linear.online import RunningFit


def parameters(estimate: RecursiveArx, stamp_ns: int) -> JointState:
    """`model_parameters`: names a1 … b1 … c; position: the coefficients, velocity: their standard errors."""
    message = _named(estimate.names(), stamp_ns)
    message.position = estimate.theta.tolist()
    message.velocity = estimate.standard_errors.tolist()
    return message


def poles(estimate: RecursiveArx, stamp_ns: int) -> JointState:
    """`model_poles`: names pole1 …; position and velocity: real and imaginary part of z, effort: |s|/2π [Hz]."""
    found = estimate.poles()
    message = _named([f"pole{i + 1}" for i in range(len(found))], stamp_ns)
    message.position = [pole.value.real for pole in found]
    message.velocity = [pole.value.imag for pole in found]
    message.effort = [pole.natural_frequency for pole in found]
    return message


def fit(step: Step, running: RunningFit, stamp_ns: int) -> JointState:
    """`model_fit`: names [one_step]; position: the prediction, velocity: its error, effort: the best fit [%]."""
    message = _named(["one_step"], stamp_ns)
    message.position, message.velocity = [step.predicted], [step.error]
    message.effort = [running.best_fit]
    return message


def health(node: str, text: str, trouble: bool, values: dict[str, object], now_ns: int) -> DiagnosticArray:
    """The row of `node`, an estimator, on `/diagnostics`."""
    level = diagnostics.WARN if trouble else diagnostics.OK
    row = diagnostics.row(f"{node}: estimate", level, text, values, "estimator")
    return diagnostics.array(now_ns, row)


def _named(names: list[str], stamp_ns: int) -> JointState:
    return JointState(header=Header(stamp=to_time(stamp_ns), frame_id=ESTIMATOR_NODE), name=names)
