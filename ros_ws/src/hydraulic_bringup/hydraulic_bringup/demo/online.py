"""The half of the demo that runs the graph: each experiment excites the plant and leaves a bag.

In lockstep the plant waits for excitation and recorder, so that a busy machine takes longer and nothing else.
"""

from __future__ import annotations

import os
import random
import signal
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Protocol

from hydraulic_bringup.verbs.virtual_bench import READY
from hydraulic_interfaces.contract import ABORTED
from hydraulic_node_utils.nodes import middleware
from hydraulic_sysid.excitation import NOT_STARTED, load_plan

from .errors import DemoError
from .processes import Child, Crew

PLANTS = {"sim": "hydraulic_sim.nodes.simulator", "can": "hydraulic_can_driver.nodes.can_driver"}
SENSORS = {
    "position_noise": 20e-6,
    "position_resolution": 24e-6,
    "pressure_noise": 15e3,
    "noise_seed": 1,
}
BUS = "bench"
# Nothing can break here, and a laptop that holds a process up for longer than the bench's 50 ms should not end a demo.
WATCHDOG_S = 0.2
SILENCE_S = 10.0  # of a plant in lockstep, until the excitation aborts
FASTEST = 4.0  # plant seconds per second of a simulator in lockstep, where the answers come so fast
# A simulated actuator may be excited again after an abort, also behind virtual CAN devices.
ATTEMPTS = 2
_CLIENT = "hydraulic_bringup.nodes._graph_client"
_START_S = 300.0  # the first start on a machine compiles the physics; a plant that dies is noticed at once
_STEP_S = 60.0
_STRETCHED = 20.0  # by how much a busy machine may stretch an experiment


class Steps(Protocol):
    """What shows the progress."""

    def begin(self, text: str, seconds: float) -> None:
        """A step begins that will take about so long [s]."""

    def tick(self) -> None:
        """Time goes by within the step."""

    def done(self) -> None:
        """The step is finished."""

    def say(self, text: str) -> None:
        """Something that the user should know."""


@dataclass(frozen=True)
class Experiment:
    """One excitation plan (a file), the name of its bag, and the silence [s] of the plant that aborts it."""

    name: str
    plan: Path
    state_timeout: float = 0.5


def run(
    plant: str, model: Path, experiments: Sequence[Experiment], out: Path, steps: Steps, lockstep: bool = True
) -> list[Path]:
    """Run the experiments on a plant and return their bags.

    :raises DemoError: a step failed; every process that was started has been ended.
    """
    if lockstep:
        experiments = [replace(experiment, state_timeout=SILENCE_S) for experiment in experiments]
    module = PLANTS[plant]
    package = module.partition(".")[0]
    if find_spec(package) is None or find_spec(f"{package}.nodes") is None or find_spec(module) is None:
        raise DemoError("plant", f"plant {plant!r} is not there: no module {module}", "use --plant sim")
    with private_domain() as env, Crew(out / "logs", env) as crew:
        client_class = import_module(_CLIENT).GraphClient
        with client_class() as client:
            simulator = _start_plant(crew, client, plant, module, model, steps, lockstep)
            bags = [record_experiment(crew, client, experiment, out, steps, ATTEMPTS) for experiment in experiments]
            steps.begin("stop the plant", 1.0)
            simulator.stop()
            steps.done()
    return bags


@contextmanager
def private_domain() -> Iterator[dict[str, str]]:
    """The environment of a ROS domain of one's own on this machine; also set in this process meanwhile."""
    changed = {**middleware.VARIABLES, "PYTHONUNBUFFERED": "1"}
    before = {name: os.environ.get(name) for name in (*changed, "ROS_DOMAIN_ID")}
    try:
        with _free_domain() as number:
            os.environ.update(changed, ROS_DOMAIN_ID=str(number))
            yield dict(os.environ)
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


@contextmanager
def _free_domain() -> Iterator[int]:
    """A domain that nobody else who asks the domain coordinator has; without it, one drawn at random."""
    if find_spec("domain_coordinator") is None:
        yield random.SystemRandom().randint(1, 100)
        return
    with import_module("domain_coordinator").domain_id() as number:
        yield int(number)


def _start_plant(crew: Crew, client, plant: str, module: str, model: Path, steps: Steps, lockstep: bool) -> Child:
    values: dict[str, object] = {"watchdog": WATCHDOG_S, "lockstep": lockstep}
    if plant == "can":
        values |= start_devices(crew, model, steps, lockstep)
    else:
        values |= {"model": str(model), **SENSORS, "real_time_factor": FASTEST if lockstep else 1.0}
    steps.begin("start the plant", 3.0)
    settings = [part for name, value in values.items() for part in ("-p", f"{name}:={value}")]
    child = crew.start("plant", module, "--ros-args", *settings)

    def meanwhile() -> None:
        crew.check("start the plant")
        steps.tick()

    for transition in ("configure", "activate"):
        if not client.change_state(transition, _START_S, meanwhile):
            meanwhile()
            why = f"it did not {transition}; its last words:\n{child.tail()}"
            raise DemoError("start the plant", why, f"log: {child.log}")
    problem = client.enable(_STEP_S)
    if problem:
        raise DemoError("start the plant", f"it was not enabled: {problem}", f"log: {child.log}")
    steps.done()
    return child


def start_devices(crew: Crew, model: Path, steps: Steps, lockstep: bool) -> dict[str, object]:
    """Start virtual CAN devices over the model, on a channel of their own; what the driver has to be told of them."""
    step = "start the virtual CAN devices"
    steps.begin(step, 3.0)
    draw = random.SystemRandom().randint
    channel = f"239.74.{draw(0, 255)}.{draw(1, 254)}:{draw(20000, 30000)}"
    line = ("--interface", "udp_multicast", "--channel", channel)
    noise = ("--position-noise", str(SENSORS["position_noise"]), "--pressure-noise", str(SENSORS["pressure_noise"]))
    module, what = "hydraulic_bringup.verbs.virtual_bench", ("--bus", str(BUS), "--model", str(model))
    child = crew.start("devices", module, *what, *line, *noise, *(["--lockstep"] if lockstep else []))
    crew.wait(lambda: READY in child.log.read_text(errors="replace"), step, _START_S, steps.tick)
    steps.done()
    return {"bus": str(BUS), "interface": line[1], "channel": channel}


def record_experiment(crew: Crew, client, experiment: Experiment, out: Path, steps: Steps, attempts: int) -> Path:
    """Its bag; an experiment that does not start or is aborted is run again while attempts are left."""
    bag = (out / experiment.name).absolute()
    for attempt in range(1, attempts + 1):
        if attempt > 1:
            _release(client, experiment, steps)
        reason = excite_and_record(crew, client, experiment, bag, steps, attempt)
        if not reason:
            return bag
        if attempt < attempts:
            aside = bag.rename(bag.with_name(f"{bag.name}.aborted"))
            steps.say(f"{experiment.name} was aborted: {reason}; running it once more (kept as {aside.name})")
    hint = "is the machine busy? Each process needs the processor a thousand times per second"
    raise DemoError(f"{experiment.name}: excite and record", f"aborted: {reason}", hint)


def _release(client, experiment: Experiment, steps: Steps) -> None:
    """The plant enabled again, if a fault or a stop has latched it at 0 V.

    :raises DemoError: it cannot be enabled.
    """
    problem = client.reset(_STEP_S)
    if problem:  # not all that a device reports is gone with a reset
        for transition in ("deactivate", "cleanup", "configure", "activate"):
            client.change_state(transition, _STEP_S, steps.tick)
        problem = client.reset(_STEP_S)
    problem = problem or client.enable(_STEP_S)
    if problem:
        raise DemoError(f"{experiment.name}: run it once more", f"the plant was not enabled again: {problem}")


def excite_and_record(crew: Crew, client, experiment: Experiment, bag: Path, steps: Steps, attempt: int) -> str:
    """Record one run into ``bag``; empty, or why the excitation aborted or did not start it.

    :raises DemoError: a process failed, or none answered.
    """
    seconds = load_plan(str(experiment.plan)).total_time
    suffix = f"{experiment.name}_{attempt}" if attempt > 1 else experiment.name
    step = f"{experiment.name}: start the recorder"
    steps.begin(step, 2.0)
    recorder = crew.start(
        f"recorder_{suffix}", "hydraulic_sysid.nodes.recorder", "--ros-args",
        "-p", f"output:={bag}", "-p", "stop_on_experiment_end:=true", "-p", "exit_when_done:=true",
    )  # fmt: skip
    crew.wait(lambda: client.recorder_status(str(bag)).get("state") == "recording", step, _STEP_S, steps.tick)
    steps.done()
    step = f"{experiment.name}: excite and record"
    steps.begin(step, seconds + 2.0)
    excitation = crew.start(
        f"excitation_{suffix}", "hydraulic_sysid.nodes.excitation", "--ros-args",
        "-p", f"plan:={experiment.plan}", "-p", "autostart:=true", "-p", "exit_when_done:=true",
        "-p", f"start_timeout:={_STEP_S}", "-p", "listeners:=2", "-p", f"state_timeout:={experiment.state_timeout}",
    )  # fmt: skip
    excitation.may_end = (0, 1)  # 1: not started, or aborted
    recorder.may_end = (0,)
    patience = _STRETCHED * seconds + 2.0 * _STEP_S
    crew.wait(lambda: excitation.exit_code is not None, step, patience, steps.tick)
    if excitation.exit_code == 0:
        crew.wait(lambda: recorder.exit_code == 0, step, _STEP_S, steps.tick)
        steps.done()
        return ""
    words = excitation.tail()  # a log is whole when its process has ended; its messages may still be on the way
    if (aborted := f" {ABORTED}: ") in words:
        crew.wait(lambda: recorder.exit_code == 0, step, _STEP_S, steps.tick)
        return words.rpartition(aborted)[2].splitlines()[0]
    if NOT_STARTED not in words:
        excitation.may_end = ()
        crew.check(step)
    recorder.stop()
    return words[words.rindex(NOT_STARTED) :].splitlines()[0]


def take_down_left(code: int) -> None:
    """The last thing of a program that may have run a graph and ends with ``code``: leave the graph."""
    if client := sys.modules.get(_CLIENT):
        client.take_down_left(code)


def interrupt_on_sigterm() -> None:
    """SIGTERM ends this program as Ctrl-C does: by `KeyboardInterrupt`, which stops every process it started."""

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    signal.signal(signal.SIGTERM, interrupt)


def timestamped_folder(root: Path, name: str) -> Path:
    """A new folder ``root/<date>-<time>-name``, and ``root/latest`` pointing to it."""
    root.mkdir(parents=True, exist_ok=True)
    folder = root / f"{time.strftime('%Y%m%d-%H%M%S')}-{name}"
    folder.mkdir()
    link = root / "latest"
    if link.is_symlink() or not link.exists():
        draft = root / f".latest.{os.getpid()}"
        draft.unlink(missing_ok=True)
        draft.symlink_to(folder.name)
        draft.replace(link)
    return folder
