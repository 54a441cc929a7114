"""Position control of a hydraulic actuator: nonlinear PID and its peers, tuning, references, controller node."""
