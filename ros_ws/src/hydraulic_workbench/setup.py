"""Build of the ROS 2 package hydraulic_workbench: every module in nodes/ and verbs/ is an executable."""

from pathlib import Path

from setuptools import find_packages, setup

NAME = "hydraulic_workbench"
DATA = ("css", "html", "ico", "js", "json", "md", "svg", "txt", "woff2", "xml", "yaml")  # installed beside the modules


def executables() -> list[str]:
    """One console script per public module of nodes/ and verbs/, named after the file."""
    files = [p for part in ("nodes", "verbs") for p in sorted(Path(NAME, part).glob("[!_]*.py"))]
    return [f"{p.stem} = {'.'.join(p.with_suffix('').parts)}:main" for p in files]


setup(
    name=NAME,
    version="0.1.0",
    packages=find_packages(include=[NAME, f"{NAME}.*"]),
    package_data={NAME: ["py.typed", *(f"**/*.{kind}" for kind in DATA), "page/vendor/**/LICENSE*"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/layouts", sorted(str(p) for p in Path("layouts").glob("*"))),
    ],
    zip_safe=False,
    extras_require={"test": ["pytest"]},
    maintainer="Hydraulic Bench Maintainers",
    maintainer_email="maintainers@users.noreply.h-seed-4219f506.example",
    license="Apache-2.0",
    entry_points={"console_scripts": executables()},
)
