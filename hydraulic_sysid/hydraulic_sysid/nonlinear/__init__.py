"""Nonlinear models of data whose units are not known; with units there are model files."""

from .valve_actuator import KNOTS, ValveActuator, fit_valve_actuator

__all__ = ["KNOTS", "ValveActuator", "fit_valve_actuator"]
