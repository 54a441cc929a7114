"""Nothing in the documentation that does not run: its commands, files, parameters, topics and tables."""

from __future__ import annotations

import argparse
import importlib
import re
import shlex
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from hydraulic_bringup import launched
from hydraulic_bringup.entry.cli import verb_names
from hydraulic_interfaces import contract
from hydraulic_interfaces.conversions import interface_class
from hydraulic_node_utils.nodes import middleware
from hydraulic_sysid.data.records import load_column_map, parse_column_map, read_records, shipped_maps
from hydraulic_sysid.excitation import load_plan

ROOT = Path(__file__).resolve().parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")), *sorted((ROOT / "examples").rglob("*.md"))]
SECURITY = {"ROS_SECURITY_KEYSTORE", "ROS_SECURITY_ENABLE", "ROS_SECURITY_STRATEGY"}
PACKAGES = sorted(path.name for path in (ROOT / "ros_ws" / "src").iterdir())


def blocks(text: str, language: str) -> list[str]:
    """The fenced blocks of a language."""
    return re.findall(rf"^```{language}\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)


def commands(text: str) -> Iterator[list[str]]:
    """The commands in its sh blocks, and those in `ros2 …` and `python -m …` lines set in by four spaces."""
    lines = [line for block in blocks(text, "sh") for line in block.splitlines()]
    lines += re.findall(r"^    (python -m .*)$", text, re.MULTILINE)
    for line in lines:
        words = shlex.split(line, comments=True)
        if words:
            yield words


COMMANDS = [
    pytest.param(words, id=f"{page.name}: {' '.join(words)}")
    for page in PAGES
    for words in commands(page.read_text(encoding="utf-8"))
]


class Parsed(Exception):  # noqa: N818 - no error
    """The command line was understood; nothing of it is to be done."""


def understood(module: str, arguments: list[str], monkeypatch: pytest.MonkeyPatch) -> argparse.Namespace:
    """What the module's own parser makes of the arguments."""
    parse = argparse.ArgumentParser.parse_args

    def stop(self: argparse.ArgumentParser, *args: Any, **more: Any) -> argparse.Namespace:
        raise Parsed(parse(self, *args, **more))

    monkeypatch.setattr(argparse.ArgumentParser, "parse_args", stop)
    try:
        code = importlib.import_module(module).main(arguments)
    except Parsed as caught:
        options: argparse.Namespace = caught.args[0]
        return options
    raise AssertionError(f"{module} does not understand {arguments}: exit code {code}")


def module_of(package: str, executable: str) -> str:
    """Module of an executable."""
    found = [
        f"{package}.{part}.{executable}"
        for part in ("nodes", "verbs")
        if (ROOT / "ros_ws" / "src" / package / package / part / f"{executable}.py").is_file()
    ]
    assert found, f"{package} has no executable {executable}"
    return found[0]


def check_verb(module: str, arguments: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """Its options are known, and what it shall read is there (or is made by a command before)."""
    options = vars(understood(module, arguments, monkeypatch))
    for path in [*(options.get("record") or []), *(options.get("file") or [])]:
        assert (ROOT / path).exists() or str(path).startswith("runs/"), path
    if options.get("columns"):
        load_column_map(options["columns"])


def check_node(module: str, arguments: list[str]) -> None:
    """Its parameters are declared, with values of their type, and named files and plans are there."""
    pytest.importorskip("rclpy")
    loaded = importlib.import_module(module)
    declared = {spec.name: spec for spec in loaded.PARAMETERS}
    if hasattr(loaded, "run_plant"):
        common = importlib.import_module("hydraulic_plant_node.nodes.plant_node").PARAMETERS
        declared |= {spec.name: spec for spec in common}
    own, _, ros = " ".join(arguments).partition("--ros-args")
    assert set(own.split()) <= ({"--autostart"} if hasattr(loaded, "run_plant") else set())
    for enclave in re.findall(r"--enclave (\S+)", ros):
        assert f'<enclave path="{enclave}">' in (ROOT / "docs/security/policy.xml").read_text(encoding="utf-8")
    pairs = re.findall(r"-p (\w+):=(\S+)", ros)
    assert len(pairs) == ros.count("-p ")
    for name, value in pairs:
        default = declared[name].default
        assert type(yaml.safe_load(value)) is type(default), f"{name}:={value}"
        if name == "plan":
            load_plan(value)
        if name == "model" and "/" in value:
            assert (ROOT / value).is_file()


@pytest.mark.parametrize("words", COMMANDS)
def test_every_command_is_one(words: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    check_command(words, monkeypatch)


def check_command(words: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    if words[:2] == ["python", "-m"]:
        package, verb, *rest = words[2:]
        check_verb(f"{package}.verbs.{verb}", rest, monkeypatch)
        return
    if words[:2] == ["ros2", "launch"]:
        package, file, *settings = words[2:]
        assert (ROOT / "ros_ws" / "src" / package / "launch" / file).is_file()
        assert {s.partition(":=")[0] for s in settings} <= {name for name, _, _ in launched.ARGUMENTS}
        return
    if words[:3] == ["ros2", "topic", "pub"]:
        name, kind, message = words[-3:]
        topic = contract.find_topic(name)
        assert kind == topic.type
        assert set(yaml.safe_load(message)) <= set(interface_class(kind).get_fields_and_field_types())
        return
    if words[:2] == ["ros2", "security"]:
        assert words[2] in ("create_keystore", "generate_artifacts")
        assert all((ROOT / file).is_file() for option, file in pairwise(words) if option == "-p")
        return
    if words[:2] == ["ros2", "run"]:
        check_node(module_of(*words[2:4]), words[4:])
        return
    if words[0] == "export":
        given = dict(word.split("=") for word in words[1:])
        assert set(given) <= {middleware.RANGE, *SECURITY}
        assert given.get(middleware.RANGE, "SUBNET") in ("SUBNET", "LOCALHOST", "SYSTEM_DEFAULT", "OFF")
        return
    assert words[0] == "./bench", words
    verb, *rest = words[1:]
    assert verb in verb_names()
    if verb == "demo":
        check_verb("hydraulic_bringup.verbs.demo", rest, monkeypatch)
    elif verb == "shell":
        assert rest[0] == "-c"
        check_command(shlex.split(rest[1]), monkeypatch)
    elif verb == "run":
        module = module_of(*rest[:2])
        if ".verbs." in module:
            check_verb(module, rest[2:], monkeypatch)
        else:
            check_node(module, rest[2:])
    else:
        assert rest == []


@pytest.mark.parametrize(
    "line",
    [
        "./bench dance",
        "./bench run hydraulic_sim submarine",
        "./bench run hydraulic_sim simulator --ros-args -p modell:=x",
        "./bench run hydraulic_sysid excitation --ros-args -p plan:=waltz",
        "./bench run hydraulic_sysid compare --record nowhere.csv --model sample_bench --out runs/x",
        "./bench run hydraulic_sysid compare --fast",
        "ros2 security generate_artifacts -k keys -p nowhere.xml",
        "ros2 run hydraulic_sim simulator --ros-args --enclave /nobody",
        "export ROS_SECURITY_ENABLED=true",
        "./bench shell -c 'ros2 launch hydraulic_bringup bench.launch.py speed:=2'",
        "python -m hydraulic_sysid guess",
    ],
)
def test_a_command_that_is_none_would_be_found(line: str, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises((AssertionError, KeyError, ValueError, SystemExit, ImportError)):
        check_command(shlex.split(line), monkeypatch)


def test_the_readme_has_commands() -> None:
    found = [" ".join(words) for words in commands(README)]
    assert {"./bench demo", "./bench test"} <= set(found)
    assert len(found) > 8


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_links_and_pictures_are_there(page: Path) -> None:
    for target in re.findall(r"\]\(([^)#]+)", page.read_text(encoding="utf-8")):
        if "://" not in target:
            assert (page.parent / target).exists(), target


@pytest.mark.parametrize("page", [ROOT / "README.md", ROOT / "docs" / "architecture.md"], ids=lambda page: page.name)
def test_paths_in_the_text_are_there(page: Path) -> None:
    """A word in code quotes with a slash is a path from the root, or from the folder of a package."""
    text = re.sub(r"^```.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    for word in re.findall(r"`([\w./-]+/[\w./-]*)`", text):
        if word.startswith(("runs/", "/")) or word in ("nodes/", "verbs/", "./bench"):
            continue
        package = word.partition("/")[0]
        places = [ROOT / word, ROOT / "ros_ws" / "src" / package / word]
        assert any(place.exists() for place in places), word


def test_the_pictures_are_small_and_each_is_shown() -> None:
    text = "".join(page.read_text(encoding="utf-8") for page in PAGES)
    for picture in (ROOT / "docs/images").iterdir():
        assert picture.stat().st_size < 400_000 and picture.name in text


def test_every_package_and_executable_stands_in_the_table() -> None:
    cells = [line.split("|") for line in README.splitlines() if line.count("|") == 4]
    rows = {name.strip(" `"): executables for _, name, _, executables, _ in cells}
    for package in PACKAGES:
        folder = ROOT / "ros_ws" / "src" / package / package
        files = [path for part in ("nodes", "verbs") for path in folder.glob(f"{part}/[!_]*.py")]
        there = {path.stem for path in files if "def main(" in path.read_text(encoding="utf-8")}
        assert set(re.findall(r"`(\w+)`", rows[package])) == there, package


def test_the_graph_shows_topics_of_the_contract() -> None:
    (graph,) = blocks(README, "mermaid")
    labels = ",".join(re.findall(r'-- "?(.*?)"? -->', graph)).replace("<br/>", "")
    shown = {name.strip() for name in labels.split(",")}
    assert {"command", "state", "experiment"} <= shown
    for name in shown:
        contract.topic(name)


def test_the_services_that_are_named_are_all() -> None:
    for service in contract.SERVICES:
        assert f"`{service.name}`" in README


def test_the_watchdog_time_is_right() -> None:
    assert f"for {1e3 * contract.WATCHDOG_S:g} ms" in " ".join(README.split())


def test_the_column_map_is_one() -> None:
    (text,) = blocks(README, "yaml")
    parsed = parse_column_map(yaml.safe_load(text))
    (part,) = parsed.parts.values()
    assert set(part) == {"drive", "position", "pressure_a"}


def test_the_headers_are_understood(tmp_path: Path) -> None:
    (text,) = blocks(README, "csv")
    header, first = text.splitlines()
    numbers = first.partition(",")[2]
    file = tmp_path / "own.csv"
    file.write_text("\n".join([header, *(f"{t:.3f},{numbers}" for t in 1e-3 * np.arange(10))]) + "\n")
    (record,) = read_records(file)
    assert set(record.channels) == {"command", "drive", "position", "pressure_a", "pressure_b"}
    assert record["position"][0] == pytest.approx(-1.25e-3)
    assert record["pressure_a"][0] == pytest.approx(71.2e5)


def test_column_maps_that_the_architecture_names_are_shipped() -> None:
    text = (ROOT / "docs/architecture.md").read_text(encoding="utf-8")
    named = re.findall(r"--columns (\w+)", text)
    assert named
    assert set(named) <= set(shipped_maps())
