"""The parameters of the excitation node."""

from hydraulic_node_utils.parameter_spec import ParameterSpec
from hydraulic_sysid.excitation import shipped_plans

PARAMETERS = (
    ParameterSpec("plan", "chirp", f"plan file, or one of {', '.join(shipped_plans())}", live=True),
    ParameterSpec("probe", "probe", "plan that measure_bandwidth plays: file or name", live=True),
    ParameterSpec("autostart", False, "start as soon as the plant is enabled and its state flows"),
    ParameterSpec("exit_when_done", False, "leave after the run: exit code 0 finished, 1 aborted", live=True),
    ParameterSpec("start_timeout", 0.0, "autostart waits no longer; 0: for ever", "s", 0.0, 3600.0),
    ParameterSpec("listeners", 1, "subscribers of command to wait for: plant, recorder, …", "", 1, 100, live=True),
    ParameterSpec("state_timeout", 0.5, "silence of the state that aborts a run", "s", 0.01, 10.0, live=True),
    ParameterSpec("applied_tolerance", 0.1, "applied and commanded drive may differ", "V", 0.0, 10.0, live=True),
)
