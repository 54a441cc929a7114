"""What needs no server: command lines of verbs, the timeline, riddles, hidden effects, health, progress, shelves."""

from __future__ import annotations

import asyncio
import json
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from ruamel.yaml import YAML

from hydraulic_sim.model_file import load_model
from hydraulic_workbench.calls import Said
from hydraulic_workbench.diagnostics import HealthBoard, Row
from hydraulic_workbench.errors import NotNowError, UnknownError, WorkbenchError
from hydraulic_workbench.folder import Folder, checked_name
from hydraulic_workbench.guess import candidates, draw
from hydraulic_workbench.plant import Plant
from hydraulic_workbench.plant_kinds import Chosen, checked_hidden
from hydraulic_workbench.progress_log import ProgressLog
from hydraulic_workbench.timeline import Step, Timeline
from hydraulic_workbench.verbs_of_jobs import VERBS, Asked, command

MODEL = "moog_mcr_m_1002_bench"


@pytest.fixture
def files(tmp_path: Path) -> dict[str, Path]:
    found = {name: tmp_path / name for name in ("model.yaml", "a.csv", "b.csv", "map.yaml", "plan.yaml")}
    for file in found.values():
        file.touch()
    return found


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_takes_the_command_line_that_is_made_for_it(verb: str, files: dict[str, Path]) -> None:
    """Parsed by the verb itself: an option that it does not have would end here."""
    from importlib import import_module

    options = {
        "effect": "valve_deadband",
        "signal": "chirp",
        "within": 60,
        "quick": True,
        "seconds": 20,
        "band": [0.1, 10.0],
        "seed": 2,
    }
    records = [] if verb in ("design", "rehearse", "next_experiment") else [(files["a.csv"], files["map.yaml"])]
    asked = Asked(files["model.yaml"], records, [], files["plan.yaml"], files["plan.yaml"].parent, options)
    name, *line = command(verb, asked, files["model.yaml"].parent / "out")
    module = import_module(f"hydraulic_sysid.verbs.{name}")
    with pytest.MonkeyPatch.context() as patch:
        seen: list[Any] = []
        patch.setattr("hydraulic_node_utils.cli.run", lambda parser, action, argv: seen.append(parser.parse_args(argv)))
        module.main([*line, "--progress"])
    assert seen and seen[0].progress


@pytest.mark.parametrize(
    ("verb", "options", "field"),
    [
        ("dig", {}, "verb"),
        ("compare", {}, "records"),
        ("add", {"effect": "../../etc"}, "effect"),
        ("add", {"effect": "--help"}, "effect"),
        ("design", {"signal": "rm -rf"}, "signal"),
        ("design", {"signal": "chirp", "band": [1]}, "band"),
        ("design", {"signal": "chirp", "duration": "long"}, "duration"),
        ("diagnose", {"within": float("inf")}, "records"),
    ],
)
def test_what_makes_no_command_line_is_refused_by_its_field(
    verb: str, options: dict[str, Any], field: str, files: dict[str, Path]
) -> None:
    with pytest.raises(WorkbenchError) as refused:
        command(verb, Asked(files["model.yaml"], options=options), Path("out"))
    assert refused.value.field == field


def test_tables_with_different_maps_do_not_go_together(files: dict[str, Path]) -> None:
    asked = Asked(files["model.yaml"], [(files["a.csv"], files["map.yaml"]), (files["b.csv"], None)])
    with pytest.raises(WorkbenchError, match="different column maps"):
        command("compare", asked, Path("out"))


def test_the_timeline_goes_back_and_on(tmp_path: Path) -> None:
    told: list[int] = []
    line = Timeline(lambda: told.append(line.index))
    for name in ("start", "one", "two"):
        (tmp_path / name).touch()
        line.add(Step("added", str(tmp_path / name)))
    line.undo()
    assert line.current.file.endswith("one") and line.can_undo
    line.add(Step("added", str(tmp_path / "start")))
    assert [Path(s.file).name for s in line.steps] == ["start", "one", "start"], "what was undone is off the way"
    line.go(0)
    with pytest.raises(NotNowError):
        line.undo()
    for nowhere in (7, -1, "0", None):
        with pytest.raises(UnknownError):
            line.go(nowhere)
    again = Timeline(lambda: None)
    again.recall(json.loads(json.dumps(line.memory())))
    assert (again.steps, again.index) == (line.steps, 0) and told
    (tmp_path / "one").unlink()
    lost = Timeline(lambda: None)
    lost.recall(line.memory())
    assert not lost.steps, "a step whose file has gone"


def test_a_riddle_tells_nothing_before_it_is_answered() -> None:
    guess = draw(load_model(MODEL), "valve_deadband", seed=3)
    assert "deadband" not in json.dumps(guess.document()).replace("null", "")
    wrong = guess.answer("supply_droop")
    assert not wrong["right"] and "effect" not in wrong and guess.document()["effect"] is None
    right = guess.answer("valve_deadband")
    assert right["right"] and right["effect"] == "valve_deadband"
    assert right["parameters"][0]["value"] == guess.values["width"] and "2 tries" in guess.text
    with pytest.raises(NotNowError):
        guess.answer("valve_deadband")


@pytest.mark.parametrize("effect", candidates())
def test_every_riddle_can_be_hidden_in_the_simulator(effect: str) -> None:
    model = load_model(MODEL)
    guess = draw(model, effect, seed=1)
    told = YAML(typ="safe").load(Chosen("guess", "", hidden={effect: guess.values}).hidden_text())
    assert told == {effect: guess.values}
    hidden = model.with_effect(effect, told[effect])
    hidden.check_complete()


def test_seeds_draw_different_riddles() -> None:
    model = load_model(MODEL)
    assert len({draw(model, seed=seed).effect for seed in range(30)}) > 4
    with pytest.raises(WorkbenchError):
        draw(model, "viscous_friction")


@pytest.mark.parametrize(
    "bad", [["valve"], {"valve": 3}, {"a b": {}}, {"valve": {"x": "1"}}, {"valve": {"x;": 1.0}}, "x"]
)
def test_hidden_effects_must_be_numbers_by_names(bad: Any) -> None:
    with pytest.raises(WorkbenchError):
        checked_hidden(bad)


def test_health_is_as_bad_as_its_worst_row_and_ages(monkeypatch: pytest.MonkeyPatch) -> None:
    board, now = HealthBoard(), time.monotonic()
    board.take([Row("a", 0, "", {"effects": "secret", "rate": "1000"}, now), Row("b", 1, "", {}, now)])
    shown = board.document(hidden=["effects"])
    assert shown["level"] == "warn" and [r["name"] for r in shown["rows"]] == ["b", "a"]
    assert shown["rows"][1]["values"] == {"rate": "1000"}
    monkeypatch.setattr(time, "monotonic", lambda: now + 10.0)
    assert board.document()["level"] == "stale" and not board.values("a")
    monkeypatch.setattr(time, "monotonic", lambda: now + 100.0)
    board.take([])
    assert not board.rows


def test_what_a_plant_says_while_it_ends_is_not_taken_for_the_next_one() -> None:
    health, board = HealthBoard(), SimpleNamespace(change=lambda *_, **__: None)
    last_words = [Row("/actuator/plant: plant", 0, "", {"enabled": "True"}, time.monotonic())]

    async def nothing_commands() -> None: ...

    async def stop(child: object) -> None:
        health.take(last_words)

    plant: Any = Plant(board, SimpleNamespace(), SimpleNamespace(stop=stop), health, nothing_commands)  # type: ignore[arg-type]
    asyncio.run(plant.stop())
    assert not health.rows


def test_a_request_to_enable_one_plant_is_not_repeated_to_the_next_one() -> None:
    asked: list[bool] = []

    async def no_answer(name: str, on: bool, patience: float) -> Said:
        asked.append(on)
        await asyncio.Event().wait()
        raise AssertionError

    async def nothing(*_: object) -> None: ...

    async def test() -> Said:
        board, graph = SimpleNamespace(change=lambda *_, **__: None), SimpleNamespace(switch=no_answer)
        plant: Any = Plant(board, graph, SimpleNamespace(stop=nothing), HealthBoard(), nothing)  # type: ignore[arg-type]
        waiting = asyncio.create_task(plant.enable(True))
        await asyncio.sleep(0.05)
        await plant.stop()
        return await asyncio.wait_for(waiting, 10.0)

    said = asyncio.run(test())
    assert not said.ok and "taken back" in said.message and asked == [True]


def test_progress_is_read_from_a_log_that_grows(tmp_path: Path) -> None:
    file = tmp_path / "log"
    log = ProgressLog(file)
    assert log.news() == []
    file.write_bytes(b'warm up\n{"progress": "fitting"}\n{"resid')
    assert log.news() == [{"progress": "fitting"}]
    with file.open("ab") as more:
        more.write(b'ual": 2.5}\n{broken\nTraceback: no\n')
    assert log.news() == [{"residual": 2.5}] and log.news() == []
    assert log.words().splitlines()[-1] == "Traceback: no"


@pytest.mark.parametrize("name", ["../x", "/etc", ".hidden", "", "a/b", 7, "x" * 100, "a\nb"])
def test_names_of_files_are_checked(name: Any) -> None:
    with pytest.raises(WorkbenchError):
        checked_name(name, "name")


def test_nothing_in_the_folder_is_replaced(tmp_path: Path) -> None:
    folder = Folder(tmp_path / "runs")
    first = folder.new(folder.records, "chirp")
    first.mkdir()
    assert folder.new(folder.records, "chirp") != first
    (folder.records / "steps.csv.gz").touch()
    assert folder.new(folder.records, "steps.csv.gz").name == "steps_2.csv.gz", "a reader knows it by its suffix"
    assert folder.new(folder.records, "../../etc/passwd").parent == folder.records
