"""A model as a Functional Mock-up Unit (FMI 2.0, co-simulation): any simulator that knows FMI runs it, without Python.

The archive holds the C sources, a binary for this platform where there is a C compiler, and the model's file. It holds
nothing of the machine on which it was made: the same model gives the same bytes but for the binary.
"""

from __future__ import annotations

import hashlib
import io
import platform
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree as Xml

from hydraulic_node_utils.whole_file import write_text

from .. import base
from ..errors import ExchangeError
from ..model import Model
from ..model_file import model_text
from .plant_source import INITIAL, PlantSource, filled, number, plant_source

WRAPPER = Path(__file__).with_name("fmu.c")
FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-fPIC", "-shared", "-fvisibility=hidden")
PLATFORMS = {"linux": "linux", "darwin": "darwin", "win32": "win"}
EXTENSIONS = {"linux": ".so", "darwin": ".dylib", "win32": ".dll"}
_LARGEST = 1e30
_EPOCH = (1980, 1, 1, 0, 0, 0)


@dataclass(frozen=True)
class Variable:
    """A variable of the FMU; its place in the list is its value reference. ``start`` None: an output."""

    name: str
    unit: str
    description: str
    causality: str
    start: float | None = None
    bounds: tuple[float, float] = (-_LARGEST, _LARGEST)


def variables(model: Model, source: PlantSource) -> Iterator[tuple[int, Variable]]:
    """Value references and variables of a model's FMU: drive, outputs, initial values, longest step, parameters."""
    yield 0, Variable("drive", "V", "held over each sample; saturates at drive_limit", "input", 0.0)
    at = 1
    for name, unit in base.OUTPUT_UNITS.items():
        what = "as its sensor reads it" if f"true_{name}" in base.OUTPUTS else "the plant's own"
        yield at, Variable(name, unit, what, "output")
        at += 1
    for name, start in zip(INITIAL, source.initial, strict=True):
        yield at, Variable(f"initial.{name}", base.OUTPUT_UNITS[name], "at the start", "parameter", start)
        at += 1
    what = "of the integrator; shorten it where parameters are made stiffer"
    yield at, Variable("longest_step", "s", what, "parameter", source.longest_step, (1e-9, 1.0))
    at += 1
    for key, place in source.parameters.items():
        record = model.parameter(key)
        start = model.value(key)
        yield at + place, Variable(key, record.unit, record.description, "parameter", start, record.bounds)


def write_fmu(model: Model, path: Path, rate: float) -> str | None:
    """Write the FMU of a model that goes by samples of 1/``rate`` [s] to ``path``.

    Returns the platform that it has a binary for (``linux64``), or None where no C compiler is found: such an FMU has
    sources alone.

    :raises EffectError: an effect that C cannot be written of.
    :raises ExchangeError: the C compiler fails.
    :raises FileExistsError: there is something at ``path``.
    """
    source = plant_source(model, rate)
    known = dict(variables(model, source))
    guid = hashlib.sha256("".join((*source.files.values(), model.name, repr(known))).encode()).hexdigest()[:32]
    files = {**source.files, WRAPPER.name: _wrapper(source, known, guid)}
    members: dict[str, bytes] = {f"sources/{name}": text.encode() for name, text in files.items()}
    members["modelDescription.xml"] = description(model, source, known, guid)
    members["resources/model.yaml"] = model_text(model, path).encode()
    made = _compiled(files)
    if made is not None:
        members[f"binaries/{_platform()}/{_identifier(model)}{EXTENSIONS[sys.platform]}"] = made
    write_text(path, _archive(members), overwrite=False)
    return None if made is None else _platform()


def _archive(members: dict[str, bytes]) -> bytes:
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in sorted(members.items()):
            info = zipfile.ZipInfo(name, _EPOCH)
            info.external_attr = 0o644 << 16
            info.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(info, content)
    return packed.getvalue()


def _identifier(model: Model) -> str:
    """A C identifier out of the model's name."""
    name = "".join(c if c.isascii() and c.isalnum() else "_" for c in model.name)
    return f"_{name}" if name[:1].isdigit() or not name else name


def _wrapper(source: PlantSource, known: dict[int, Variable], guid: str) -> str:
    length = 1 + len(base.OUTPUTS) + len(INITIAL) + 1 + source.n_parameters
    bounds = [known[i].bounds if i in known else (0.0, -1.0) for i in range(length)]  # none: cannot be set
    values = {
        "GUID": guid,
        "RATE": number(float(source.rate)),
        "LOWEST": ", ".join(number(low) for low, _ in bounds),
        "HIGHEST": ", ".join(number(high) for _, high in bounds),
    }
    return filled(WRAPPER.read_text(encoding="utf-8"), values)


def description(model: Model, source: PlantSource, known: dict[int, Variable], guid: str) -> bytes:
    """modelDescription.xml (FMI 2.0.4, sections 2.2 and 4.3)."""
    root = Xml.Element(
        "fmiModelDescription", fmiVersion="2.0", modelName=model.name, guid=guid,
        description=f"electro-hydraulic actuator with {', '.join(model.effects) or 'base physics alone'}",
        generationTool="hydraulic_sim", variableNamingConvention="structured",
    )  # fmt: skip
    unit = Xml.SubElement(
        root, "CoSimulation", modelIdentifier=_identifier(model), canHandleVariableCommunicationStepSize="true",
        canGetAndSetFMUstate="true", canSerializeFMUstate="true", canNotUseMemoryManagementFunctions="true",
    )  # fmt: skip
    sources = Xml.SubElement(unit, "SourceFiles")
    for name in ("plant.c", WRAPPER.name):
        Xml.SubElement(sources, "File", name=name)
    units = Xml.SubElement(root, "UnitDefinitions")
    for name in sorted({v.unit for v in known.values()}):
        Xml.SubElement(units, "Unit", name=name)
    categories = Xml.SubElement(root, "LogCategories")
    Xml.SubElement(categories, "Category", name="logStatusError")
    Xml.SubElement(root, "DefaultExperiment", startTime="0", stopTime="10", stepSize=repr(1.0 / source.rate))
    listed = Xml.SubElement(root, "ModelVariables")
    for at, variable in sorted(known.items()):
        _add(listed, at, variable)
    structure = Xml.SubElement(root, "ModelStructure")
    outputs = [i for i, (_, v) in enumerate(sorted(known.items()), 1) if v.causality == "output"]
    for part in ("Outputs", "InitialUnknowns"):
        within = Xml.SubElement(structure, part)
        for index in outputs:
            Xml.SubElement(within, "Unknown", index=str(index))
    Xml.indent(root)
    return Xml.tostring(root, "utf-8", xml_declaration=True)


def _add(listed: Xml.Element, at: int, variable: Variable) -> None:
    variability = {"input": "continuous", "output": "continuous", "parameter": "fixed"}[variable.causality]
    scalar = Xml.SubElement(
        listed, "ScalarVariable", name=variable.name, valueReference=str(at), causality=variable.causality,
        variability=variability, description=variable.description,
    )  # fmt: skip
    real = Xml.SubElement(scalar, "Real", unit=variable.unit)
    if variable.start is not None:
        real.set("start", repr(float(variable.start)))
        if variable.causality == "parameter":
            scalar.set("initial", "exact")
    else:
        scalar.set("initial", "calculated")
    if variable.bounds != (-_LARGEST, _LARGEST):
        real.set("min", repr(float(variable.bounds[0])))
        real.set("max", repr(float(variable.bounds[1])))


def _platform() -> str:
    """The folder of this platform's binaries, as FMI names it."""
    bits = 64 if sys.maxsize > 2**32 else 32
    machine = platform.machine().lower()
    name = PLATFORMS.get(sys.platform, sys.platform)
    return f"{name}{bits}" if machine in ("x86_64", "amd64", "i386", "i686") else f"{machine}-{name}"


def compiler() -> str | None:
    """The C compiler of this machine: ``cc``, ``gcc`` or ``clang``; None where there is none."""
    return next((found for name in ("cc", "gcc", "clang") if (found := shutil.which(name))), None)


def _compiled(files: dict[str, str]) -> bytes | None:
    """The shared library of the sources; None without a compiler."""
    program = compiler()
    if program is None or sys.platform not in EXTENSIONS:
        return None
    with tempfile.TemporaryDirectory(prefix="hydraulic-export-") as folder:
        for name, text in files.items():
            Path(folder, name).write_text(text, encoding="utf-8")
        units = sorted(name for name in files if name.endswith(".c"))
        command = [program, *FLAGS, *units, "-o", "fmu", "-lm"]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        if done.returncode:
            raise ExchangeError(f"the C compiler {program} fails on the model's sources:\n{done.stderr.strip()}")
        return Path(folder, "fmu").read_bytes()
