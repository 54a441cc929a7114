"""The packages are complete ROS 2 packages: manifests, executables, installed data, pins."""

from __future__ import annotations

import ast
import importlib
import os
import re
import runpy
import subprocess
import sys
from importlib.metadata import packages_distributions
from pathlib import Path
from typing import Any

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[2]
WORKSPACE = ROOT / "ros_ws"
PACKAGES = {manifest.parent.name: manifest.parent for manifest in sorted(WORKSPACE.glob("src/*/package.xml"))}
NAMES = sorted(PACKAGES)
LIBRARIES = {"hydraulic_interfaces", "hydraulic_node_utils", "hydraulic_plant_node"}  # without executables

every_package = pytest.mark.parametrize("name", NAMES)


def setup_arguments(name: str, monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """What setup.py of a package hands to setuptools."""
    handed: dict[str, Any] = {}
    monkeypatch.setattr("setuptools.setup", lambda **arguments: handed.update(arguments))
    monkeypatch.chdir(PACKAGES[name])
    runpy.run_path("setup.py", run_name="__main__")
    return handed


def sources(name: str) -> list[Path]:
    """Python files of a package."""
    return sorted((PACKAGES[name] / name).rglob("*.py"))


def test_the_workspace_holds_the_packages() -> None:
    assert NAMES == [
        "hydraulic_bringup",
        "hydraulic_can_driver",
        "hydraulic_control",
        "hydraulic_interfaces",
        "hydraulic_node_utils",
        "hydraulic_plant_node",
        "hydraulic_sim",
        "hydraulic_sysid",
        "hydraulic_workbench",
    ]


@every_package
def test_links_in_the_workspace_are_relative_and_stay_in_the_repository(name: str) -> None:
    folder = PACKAGES[name]
    assert ROOT in folder.resolve().parents
    if folder.is_symlink():
        assert not os.path.isabs(os.readlink(folder))


@every_package
def test_manifest_is_valid_and_complete(name: str) -> None:
    catkin_pkg = pytest.importorskip("catkin_pkg.package")
    warnings: list[str] = []
    package = catkin_pkg.parse_package(str(PACKAGES[name]), warnings=warnings)
    package.validate(warnings=warnings)
    assert warnings == []
    assert package.name == name
    assert package.licenses == ["Apache-2.0"]
    assert package.get_build_type() == "ament_python"
    assert all(re.fullmatch(r"[^@\s]+@[^@\s]+\.[a-z]+", person.email) for person in package.maintainers)


@every_package
def test_marker_licence_and_script_folder(name: str) -> None:
    folder = PACKAGES[name]
    assert (folder / "resource" / name).is_file()
    assert "Apache License" in (folder / "LICENSE").read_text()
    configuration = (folder / "setup.cfg").read_text()
    assert f"script_dir=$base/lib/{name}" in configuration
    assert f"install_scripts=$base/lib/{name}" in configuration


@every_package
def test_setup_and_manifest_agree(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    catkin_pkg = pytest.importorskip("catkin_pkg.package")
    package = catkin_pkg.parse_package(str(PACKAGES[name]))
    handed = setup_arguments(name, monkeypatch)
    person = package.maintainers[0]
    assert (handed["name"], handed["version"], handed["license"]) == (name, package.version, package.licenses[0])
    assert (handed["maintainer"], handed["maintainer_email"]) == (person.name, person.email)
    installed = {target: files for target, files in handed["data_files"]}
    assert installed["share/ament_index/resource_index/packages"] == [f"resource/{name}"]
    assert "package.xml" in installed[f"share/{name}"]


def test_all_packages_have_one_maintainer_who_is_not_made_up(monkeypatch: pytest.MonkeyPatch) -> None:
    (address,) = {setup_arguments(name, monkeypatch)["maintainer_email"] for name in NAMES}
    assert not re.search(r"@(.+\.)?example\.(com|org|net)$", address)


def test_all_packages_have_one_version(monkeypatch: pytest.MonkeyPatch) -> None:
    versions = {setup_arguments(name, monkeypatch)["version"] for name in NAMES}
    assert versions == {re.search(r'^version = "(.+)"$', (ROOT / "pyproject.toml").read_text(), re.M)[1]}  # type: ignore[index]


@every_package
def test_every_public_node_and_verb_is_an_executable(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    handed = setup_arguments(name, monkeypatch)
    listed = handed.get("entry_points", {}).get("console_scripts", [])
    entries = dict(entry.split(" = ") for entry in listed)
    files = [p for part in ("nodes", "verbs") for p in (PACKAGES[name] / name / part).glob("[!_]*.py")]
    expected = set() if name in LIBRARIES else {p.stem for p in files}
    assert set(entries) == expected
    assert len(listed) == len(entries), "two executables of one name"


@every_package
def test_every_executable_has_a_main(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    handed = setup_arguments(name, monkeypatch)
    for entry in handed.get("entry_points", {}).get("console_scripts", []):
        module, function = entry.split(" = ")[1].split(":")
        path = PACKAGES[name].joinpath(*module.split(".")).with_suffix(".py")
        if imports_of(path) & ROS_MODULES:
            pytest.importorskip("rclpy")
        assert callable(getattr(importlib.import_module(module), function))


@every_package
def test_everything_beside_the_sources_is_installed(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    patterns = setup_arguments(name, monkeypatch)["package_data"][name]
    folder = PACKAGES[name] / name
    installed = {file for pattern in patterns for file in folder.glob(pattern)}
    beside = {
        file
        for file in folder.rglob("*")
        if file.is_file()
        and file.suffix not in (".py", ".pyc")
        and not any(part.startswith((".", "__pycache__")) for part in file.relative_to(folder).parts)
    }
    assert beside - installed == set()


@every_package
def test_every_folder_with_modules_is_a_package(name: str) -> None:
    for file in sources(name):
        assert (file.parent / "__init__.py").exists(), f"{file.relative_to(ROOT)} would not be installed"


ROS_MODULES = {
    "rclpy",
    "builtin_interfaces",
    "diagnostic_msgs",
    "lifecycle_msgs",
    "rcl_interfaces",
    "rosgraph_msgs",
    "sensor_msgs",
    "std_msgs",
    "std_srvs",
    *NAMES,
}


def imports_of(path: Path) -> set[str]:
    """Top-level names a file imports."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and not node.level and node.module:
            found.add(node.module.split(".")[0])
    return found


@every_package
def test_manifest_declares_the_ros_packages_that_are_imported(name: str) -> None:
    catkin_pkg = pytest.importorskip("catkin_pkg.package")
    declared = {d.name for d in catkin_pkg.parse_package(str(PACKAGES[name])).exec_depends}
    imported = {module for file in sources(name) for module in imports_of(file)}
    assert (imported & ROS_MODULES) - {name} <= declared


ROSDEP = {
    "aiohttp": "python3-aiohttp",
    "can": "python3-can",
    "canopen": "canopen-pip",
    "control": "python-control-pip",
    "h5py": "python3-h5py",
    "jinja2": "python3-jinja2",
    "numba": "python3-numba",
    "numpy": "python3-numpy",
    "rich": "python3-rich",
    "rosbags": "python3-rosbags-pip",
    "ruamel": "python3-ruamel.yaml",
    "scipy": "python3-scipy",
}
"""Keys of rosdep (rosdistro of August 2026, Ubuntu) by what is imported."""
WITHOUT_KEY = {
    *("daqp", "distributed", "fmpy", "markupsafe", "mcap", "pint", "plotly", "pyarrow", "zstandard"),
}
TEST_KEYS = {"domain_coordinator", "python3-hypothesis", "python3-pytest", "python3-pytest-timeout"}


@every_package
def test_manifest_names_the_libraries_that_are_imported(name: str) -> None:
    """As rosdep keys, or in the comment that says what rosdep does not know."""
    catkin_pkg = pytest.importorskip("catkin_pkg.package")
    package = catkin_pkg.parse_package(str(PACKAGES[name]))
    text = (PACKAGES[name] / "package.xml").read_text(encoding="utf-8")
    comment = re.search(r"installed from pyproject.toml: (.+?)\. -->", text)
    modules = {module for file in sources(name) for module in imports_of(file)}
    owners = packages_distributions()
    libraries = {
        module
        for module in modules - sys.stdlib_module_names - set(NAMES) - ROS_MODULES
        if not any(owner.startswith("ros-") for owner in owners.get(module, []))
    }
    assert libraries <= set(ROSDEP) | WITHOUT_KEY
    assert {dependency.name for dependency in package.exec_depends} >= {ROSDEP[m] for m in libraries & set(ROSDEP)}
    assert set(comment[1].split(", ") if comment else ()) == libraries & WITHOUT_KEY
    keys = {dependency.name for dependency in package.exec_depends if "-" in dependency.name}
    assert keys <= set(ROSDEP.values()), "no key that rosdep does not know"
    assert {dependency.name for dependency in package.test_depends} == TEST_KEYS


@every_package
def test_colcon_runs_the_tests_of_the_package(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    assert setup_arguments(name, monkeypatch)["extras_require"] == {"test": ["pytest"]}, "by pytest"
    option, settings, *folders = yaml.safe_load((PACKAGES[name] / "colcon.pkg").read_text())["pytest-args"]
    home = PACKAGES[name].resolve()
    assert (option, (home / settings).resolve()) == ("-c", ROOT / "pyproject.toml")
    assert folders and all(any((home / folder).glob("test_*.py")) for folder in folders)


def test_colcon_runs_all_tests() -> None:
    files = [folder.resolve() / "colcon.pkg" for folder in PACKAGES.values()]
    run = [(f.parent / at).resolve() for f in files for at in yaml.safe_load(f.read_text())["pytest-args"][2:]]
    assert sorted(run) == sorted({file.parent for file in (ROOT / "tests").rglob("test_*.py")})


def test_colcon_test_runs_them(tmp_path: Path) -> None:
    pytest.importorskip("colcon_ros")
    if not (WORKSPACE / "install/hydraulic_interfaces/share/hydraulic_interfaces/package.sh").is_file():
        pytest.skip("the workspace was not built")
    colcon = "import sys; from colcon_core.command import main; sys.exit(main())"
    chosen = ["--base-paths", "src", "--packages-select", "hydraulic_interfaces"]
    results = ["--test-result-base", str(tmp_path), "--event-handlers", "console_direct+"]
    tried = subprocess.run(
        [sys.executable, "-c", colcon, "--log-base", str(tmp_path / "log"), "test", *chosen, *results]
        + ["--pytest-args", " -k", "test_clock_encoder"],
        cwd=WORKSPACE,
        capture_output=True,
        text=True,
        check=False,
    )
    assert tried.returncode == 0 and "1 passed" in tried.stdout, tried.stdout + tried.stderr
    assert 'failures="0"' in (tmp_path / "hydraulic_interfaces/pytest.xml").read_text()


def test_colcon_knows_all_packages_as_ros_packages(tmp_path: Path) -> None:
    pytest.importorskip("colcon_ros")
    command = "import sys; from colcon_core.command import main; sys.exit(main())"
    listed = subprocess.run(
        [sys.executable, "-c", command, "--log-base", str(tmp_path), "list", "--base-paths", "src"],
        cwd=WORKSPACE,
        capture_output=True,
        text=True,
        check=True,
    )
    rows = [line.split("\t") for line in listed.stdout.splitlines()]
    assert [(name, kind) for name, _, kind in rows] == [(name, "(ros.ament_python)") for name in NAMES]


def dependency_groups() -> dict[str, list[str]]:
    """The groups of pyproject.toml."""
    tomllib = pytest.importorskip("tomllib")
    return tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["dependency-groups"]


def test_every_version_is_pinned() -> None:
    for group, requirements in dependency_groups().items():
        for requirement in requirements:
            stock_numpy = group == "ros2-stock" and requirement.startswith("numpy>=1.26.4,<2")
            assert stock_numpy or re.fullmatch(r"[a-z0-9.\-]+==[0-9.]+", requirement), requirement


def test_every_library_that_is_imported_is_pinned() -> None:
    """A library that only comes along with another one may be gone with the next version of that."""
    pinned = {re.split("[=<>]", r)[0] for group in ("library", "ros2-wheels") for r in dependency_groups()[group]}
    distributions = packages_distributions()
    for name in NAMES:
        for file in sources(name):
            for module in imports_of(file) - sys.stdlib_module_names - set(NAMES):
                owners = {owner.lower() for owner in distributions.get(module, [])}
                of_ros = module in ROS_MODULES or any(owner.startswith("ros-") for owner in owners)
                assert of_ros or owners & pinned, f"{file.relative_to(ROOT)} imports {module}, pinned nowhere"


def test_no_package_is_pinned_twice_for_one_kind_of_ros() -> None:
    groups = dependency_groups()
    for kind in ("ros2-wheels", "ros2-stock"):
        names = [re.split("[=<>]", r)[0] for group in ("library", kind, "tools") for r in groups[group]]
        assert len(names) == len(set(names))


def test_entry_and_ci_take_the_pythons_the_project_says() -> None:
    text = (ROOT / "pyproject.toml").read_text()
    oldest, after = re.search(r'requires-python = ">=3\.(\d+),<3\.(\d+)"', text).groups()  # type: ignore[union-attr]
    entry = (ROOT / "bench").read_text()
    assert f"\noldest={oldest} " in entry
    assert f"\nnewest={int(after) - 1} " in entry
    assert f"(3, {oldest}) <= sys.version_info[:2] <= (3, {int(after) - 1})" in (ROOT / ".ci/run").read_text()


def test_launch_files_are_installed_and_parse(monkeypatch: pytest.MonkeyPatch) -> None:
    handed = setup_arguments("hydraulic_bringup", monkeypatch)
    files = dict(handed["data_files"])["share/hydraulic_bringup/launch"]
    assert [Path(file).name for file in files] == sorted(p.name for p in Path("launch").glob("*.launch.py"))
    assert "launch/bench.launch.py" in files
    for file in files:
        tree = ast.parse(Path(file).read_text(encoding="utf-8"))
        assert "generate_launch_description" in {n.name for n in tree.body if isinstance(n, ast.FunctionDef)}
