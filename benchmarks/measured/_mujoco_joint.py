"""One servo joint identified by `mujoco.sysid` (PyPI package mujoco[sysid]), with its default optimiser and settings.

    python benchmarks/measured/_mujoco_joint.py RECORDS.npz RESULT.json

RECORDS.npz holds time, command and position (N,) of each record as ``NAME/time`` and so on; those called ``fit.…`` are
fitted, those called ``test.…`` are run with what came out. The joint is a hinge with a position actuator; identified
are the actuator's gains, damping, armature and dry friction of the joint, mass and centre of mass of the arm. It runs
in an interpreter of its own: nothing here needs the packages of the bench.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import mujoco
import numpy as np
from mujoco import sysid

MODEL = """
<mujoco>
  <option timestep="{step}" integrator="implicitfast"/>
  <worldbody>
    <body name="arm">
      <joint name="joint" type="hinge" axis="0 1 0" damping="0.6" armature="0.03" frictionloss="0.05"/>
      <inertial pos="0.05 0 -0.05" mass="0.2" diaginertia="1e-4 1e-4 1e-4"/>
    </body>
  </worldbody>
  <actuator><position name="servo" joint="joint" kp="10" kv="0.5"/></actuator>
  <sensor><jointpos name="angle" joint="joint"/></sensor>
</mujoco>
"""
SUBSTEPS = 4


def parameters(spec: mujoco.MjSpec) -> sysid.ParameterDict:
    """What is identified, from the values of the model on."""

    def joint(name: str):
        return lambda s, p: setattr(s.joint("joint"), name, p.value[0])

    def damping(s, p):
        s.joint("joint").damping = np.array([p.value[0], *np.ravel(s.joint("joint").damping)[1:]])

    def mass(s, p):
        s.body("arm").mass = p.value[0]

    def centre(s, p):
        s.body("arm").ipos = np.array([p.value[0], 0.0, p.value[1]])

    found = sysid.ParameterDict()
    for one in (
        sysid.Parameter("gains", [10.0, 0.5], [0.5, 0.0], [100.0, 20.0],
                        modifier=lambda s, p: sysid.apply_pdgain(s, "servo", p.value)),
        sysid.Parameter("damping", 0.6, 0.0, 10.0, modifier=damping),
        sysid.Parameter("armature", 0.03, 1e-3, 0.5, modifier=joint("armature")),
        sysid.Parameter("frictionloss", 0.05, 0.0, 1.0, modifier=joint("frictionloss")),
        sysid.Parameter("mass", 0.2, 0.01, 2.0, modifier=mass),
        sysid.Parameter("centre", [0.05, -0.05], [-0.3, -0.3], [0.3, 0.3], modifier=centre),
    ):  # fmt: skip
        found.add(one)
    return found


def main() -> None:
    records = np.load(sys.argv[1])
    names = sorted({key.rsplit("/", 1)[0] for key in records.files})
    series = {n: {c: records[f"{n}/{c}"] for c in ("time", "command", "position")} for n in names}
    dt = float(np.median(np.diff(series[names[0]]["time"])))
    spec = mujoco.MjSpec.from_string(MODEL.format(step=dt / SUBSTEPS))
    model = spec.compile()

    def sequences(which: list[str]) -> sysid.ModelSequences:
        control, sensors, states = [], [], []
        for n in which:
            s = series[n]
            # commands are held until the next
            fine = s["time"][0] + dt / SUBSTEPS * np.arange(SUBSTEPS * (len(s["time"]) - 1) + 1)
            held = s["command"][np.minimum(np.arange(fine.size) // SUBSTEPS, len(s["time"]) - 1)]
            control.append(sysid.TimeSeries.from_control_names(fine, held[:, None], model))
            sensors.append(sysid.TimeSeries.from_names(s["time"], s["position"][:, None], model, names=["angle"]))
            states.append(sysid.create_initial_state(model, np.array([s["position"][0]])))
        return sysid.ModelSequences("joint", spec, which, states, control, sensors)

    start = parameters(spec)
    fit, test = ([n for n in names if n.startswith(role)] for role in ("fit", "test"))
    done, result = sysid.optimize(start, sysid.build_residual_fn(models_sequences=[sequences(fit)]), verbose=False)
    errors = {}
    for n in fit + test:
        fn = sysid.build_residual_fn(models_sequences=[sequences([n])], return_pred_all=True)
        _, predicted, measured = fn(done.as_vector(), done)
        p = predicted[0][0] if isinstance(predicted[0], (list, tuple)) else predicted[0]
        angle = np.interp(series[n]["time"], p.times, np.ravel(p.data))
        errors[n] = float(np.sqrt(np.mean((angle - series[n]["position"]) ** 2)))
    values = {key: np.ravel(done[key].value).tolist() for key in list(done.keys())}
    Path(sys.argv[2]).write_text(
        json.dumps({"version": mujoco.__version__, "rmse": errors, "parameters": values, "free": int(done.size)})
    )


if __name__ == "__main__":
    main()
