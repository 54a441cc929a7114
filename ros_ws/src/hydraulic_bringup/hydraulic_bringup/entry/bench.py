"""From a fresh checkout to a built workspace: checks what is there, does only what is missing."""

from __future__ import annotations

import os
import platform
import pwd
import signal
import sys
import tempfile
import time
from collections.abc import Mapping

from . import environment_plan, host, virtualenv, workspace
from .checkout import Checkout
from .environment import build_variables, command_variables
from .lock import exclusive
from .ros import Ros, sourced, without_foreign


class Bench:
    """One call of `./bench`: its checkout, its ROS 2, its variables."""

    def __init__(self, checkout: Checkout, environ: Mapping[str, str]) -> None:
        self.checkout = checkout
        self.environ = with_home(without_foreign(environ))
        self.ros: Ros = sourced(self.environ)

    def variables(self) -> dict[str, str]:
        """The variables a command of the bench runs with."""
        return command_variables(self.checkout, self.ros, self.environ)

    def prepare(self, *, rebuild: bool = False) -> int:
        """Make the environment and build the workspace, as far as not done yet; count of packages built.

        :param rebuild: build every package, changed or not
        :raises BenchError: a step failed
        """
        need = self.needed_environment()
        if (
            not rebuild
            and environment_plan.current(self.checkout, need).action == "keep"
            and not self._state(need).stale()
        ):
            return 0
        start = time.monotonic()
        with exclusive(self.checkout.logs / "lock") as lock:
            todo = environment_plan.current(self.checkout, need)  # another ./bench may have done it meanwhile
            if todo.action != "keep":
                virtualenv.carry_out(todo, need, self.checkout, self.ros, self.environ, lock)
            state = self._state(need)
            packages = list(state.sources) if rebuild else list(state.stale())
            if packages:
                variables = build_variables(self.checkout, self.ros, self.environ)
                workspace.build(state, packages, variables, lock)
        if time.monotonic() - start > 20.0:
            print(f"Set up in {time.monotonic() - start:.0f} s.", file=sys.stderr, flush=True)
        return len(packages)

    def needed_environment(self) -> environment_plan.Stamp:
        """The virtual environment this call needs.

        :raises BenchError: the sourced ROS 2 needs a Python that is not there, or there is no ROS 2 for this machine
        """
        host.check_machine(platform.machine(), self.ros)
        return environment_plan.wanted(self.checkout, self.ros, named=bool(self.environ.get("BENCH_PYTHON")))

    def stale_packages(self) -> dict[str, str]:
        """Packages that have to be built, each with the reason."""
        return self._state(self.needed_environment()).stale()

    def _state(self, need: environment_plan.Stamp) -> workspace.Build:
        return workspace.Build(self.checkout, key=f"Python {need.python}, {need.ros}, {need.root}")

    def replace_process(self, command: list[str], variables: Mapping[str, str] | None = None) -> int:
        """Become `command`: its signals, its terminal and its exit code are those of `./bench`."""
        sys.stdout.flush()
        sys.stderr.flush()
        for ignored in (signal.SIGPIPE, signal.SIGXFSZ):  # Python ignores them, and exec would pass that on
            signal.signal(ignored, signal.SIG_DFL)
        variables = self.variables() if variables is None else variables
        os.execvpe(command[0], command, dict(variables))


def with_home(environ: Mapping[str, str]) -> dict[str, str]:
    """`environ` with a home folder: without one rclpy has no place for its log files and does not start."""
    if environ.get("HOME"):
        return dict(environ)
    try:
        home = pwd.getpwuid(os.getuid()).pw_dir
    except KeyError:  # a user id without a name, as containers have it
        home = ""
    return {**environ, "HOME": home if os.access(home, os.W_OK) else tempfile.gettempdir()}
