"""Build of the ROS 2 package hydraulic_plant_node: a library, its nodes/ holds base classes."""

from setuptools import find_packages, setup

NAME = "hydraulic_plant_node"
DATA = ("csv", "csv.gz", "css", "eds", "html", "js", "json", "xml", "yaml")  # files installed beside the modules

setup(
    name=NAME,
    version="0.1.0",
    packages=find_packages(include=[NAME, f"{NAME}.*"]),
    package_data={NAME: ["py.typed", *(f"**/*.{kind}" for kind in DATA)]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
    ],
    zip_safe=False,
    extras_require={"test": ["pytest"]},
    maintainer="Hydraulic Bench Maintainers",
    maintainer_email="maintainers@users.noreply.h-seed-4219f506.example",
    license="Apache-2.0",
)
