"""Who comes second does not get the name, and a process that dies gives it back."""

from __future__ import annotations

import os
import subprocess
import sys
import uuid

from hydraulic_plant_node.name_claim import NameClaim

HOLD = """
import sys
from hydraulic_plant_node.name_claim import NameClaim
claim = NameClaim(sys.argv[1])
print(claim.take(), flush=True)
sys.stdin.read()
"""


def test_one_claim_per_name() -> None:
    name = uuid.uuid4().hex * 10
    first, second = NameClaim(name), NameClaim(name)
    assert first.take() and first.take()
    assert not second.take() and NameClaim(name + "x").take()
    second.give_back()
    assert not second.take(), "only who has a claim can give it back"
    first.give_back()
    assert second.take()


def test_a_killed_process_leaves_no_claim_behind() -> None:
    name = uuid.uuid4().hex
    command = [sys.executable, "-c", HOLD, name]
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=env) as other:
        assert other.stdout is not None and other.stdout.readline().strip() == "True"
        assert not NameClaim(name).take()
        other.kill()
        other.wait()
        assert NameClaim(name).take()
