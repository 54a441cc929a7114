"""What can be set on the reference node: the trajectory, its limits, and when it starts and ends."""

from hydraulic_control.trajectories import KINDS
from hydraulic_node_utils.parameter_spec import ParameterSpec

PARAMETERS = (
    ParameterSpec("kind", "step", f"trajectory: {', '.join(KINDS)}", live=True),
    ParameterSpec("offset", 0.0, "where it begins, or what it swings around", "m", -100.0, 100.0, live=True),
    ParameterSpec("amplitude", 0.05, "step, way or amplitude", "m", -100.0, 100.0, live=True),
    ParameterSpec("frequency", 0.5, "of sine, triangle and minimum_jerk", "Hz", 1e-3, 100.0, live=True),
    ParameterSpec("cycles", 3, "of sine and triangle", "", 1, 10_000, live=True),
    ParameterSpec("levels", 4, "of the staircase, up and down again", "", 1, 1000, live=True),
    ParameterSpec("dwell", 2.0, "rest after a step, on a level, at the turn", "s", 0.0, 3600.0, live=True),
    ParameterSpec("file", "", "of playback: CSV with the columns time_s and position_m", live=True),
    ParameterSpec("travel_limit", 0.6, "largest position to either side", "m", 0.0, 100.0, live=True),
    ParameterSpec("velocity_limit", 0.4, "largest velocity", "m/s", 1e-4, 100.0, live=True),
    ParameterSpec("acceleration_limit", 10.0, "largest acceleration", "m/s^2", 1e-3, 1e4, live=True),
    ParameterSpec("autostart", False, "start with the first state while a controller listens"),
    ParameterSpec("exit_when_done", False, "leave after the run: exit code 0 played, 1 broken off", live=True),
    ParameterSpec("output", "", "new JSON file for the response; empty: none is kept"),
    ParameterSpec("state_timeout", 0.5, "silence of the state that breaks a run off", "s", 0.01, 10.0, live=True),
)
