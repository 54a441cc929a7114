"""The worked example of docs/user-effects.md: a leak at one worn place of the barrel, which no library knows.

A small library and few places for curves compile quickly; the records are of the independent plant.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from hidden_effects import benches
from hydraulic_sim import registry
from hydraulic_sim.model_file import load_model
from hydraulic_sysid.diagnosis.proposed_effect import proposal
from hydraulic_sysid.diagnosis.search import nonparametric_curves
from hydraulic_sysid.verbs.add import main as add
from hydraulic_sysid.verbs.diagnose import main as diagnose

BENCH = benches.Bench("unknown", ("worn_barrel_leakage",), "strong", 1)
SECONDS = 5
LIBRARY = ("end_stop", "viscous_friction", "coulomb_friction", "internal_leakage", "constant_load")
PLACES = ("unknown_conductance", "unknown_force")


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory):
    """A folder with two records to learn from, one that nothing sees, and the user's model file."""
    folder = tmp_path_factory.mktemp("worn_barrel")
    made = benches.make(BENCH, names=("triangle", "steps", "multisine"))
    for name, part in (("known", ("triangle", "steps")), ("unseen", ("multisine",))):
        benches.write_records(
            {n: {c: v[: 1000 * SECONDS] for c, v in made[n].items()} for n in part},
            folder / name,
            BENCH.setting.decimals,
        )
    (folder / "model.yaml").write_text(benches.model_text(BENCH))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(registry, "_BUILTIN", [registry.Library([registry.library().file(n) for n in LIBRARY])])
        files = tuple(f for f in nonparametric_curves.FILES if f.stem in PLACES)
        patch.setattr(nonparametric_curves, "FILES", files)
        patch.setattr(proposal, "FILES", files)
        yield folder


def document(folder: Path, verb: str) -> dict[str, Any]:
    return json.loads((folder / f"{verb}.json").read_text())


@pytest.mark.timeout(600)
def test_what_no_library_knows_is_proposed_joined_and_explains_the_records(bench: Path, capsys) -> None:
    known, unseen, effect = str(bench / "known"), str(bench / "unseen"), bench / "worn_barrel.py"
    command = ["--model", str(bench / "model.yaml"), "--record", known]
    assert diagnose([*command, "--quick", "--propose", str(effect), "--apply", "--out", str(bench / "before")]) == 1
    found = document(bench / "before", "diagnose")
    assert found["verdict"]["kind"] == "outside the library", found["verdict"]["text"]
    assert found["verdict"]["text"].endswith("A quick look: what is small may be missed.")
    proposed = found["proposed_effect"]
    assert (proposed["subsystem"], proposed["variable"], proposed["beside"]) == ("flow", "position", [])
    assert proposed["explained_share"] > 0.9
    assert not (bench / "before" / "model.yaml").exists() and "no model.yaml" in capsys.readouterr().err
    assert "proposed by diagnose from steps, triangle" in effect.read_text()

    assert diagnose([*command, "--propose", str(effect), "--out", str(bench / "again")]) == 2
    assert "never overwritten" in capsys.readouterr().err

    assert add([str(effect), *command, "--holdout", unseen, "--out", str(bench / "joined")]) == 0
    fall = document(bench / "joined", "add")["test"]
    assert fall["before"] > 1.1 and fall["after"] < 1.02, fall
    joined = load_model(bench / "joined" / "model.yaml")
    assert joined.user_effects == ((bench / "joined" / "worn_barrel.py").resolve(),)
    assert "worn_barrel" in joined.effects and joined.history[-1]["change"] == "added worn_barrel"

    command = ["--model", str(bench / "joined" / "model.yaml"), "--record", known, unseen]
    assert diagnose([*command, "--quick", "--propose", str(bench / "more.py"), "--out", str(bench / "after")]) == 0
    assert document(bench / "after", "diagnose")["verdict"]["kind"] == "complete"
    assert not (bench / "more.py").exists() and "not outside the library" in capsys.readouterr().err
