"""Files that a user is given: damaged and malicious ones are read, or refused with an error that names them."""

from __future__ import annotations

import gzip
import math
import random
import shutil
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path

import numpy as np

from hydraulic_can_driver import bus_file
from hydraulic_can_driver.bench import LONGEST_LOSS_S
from hydraulic_control import gains_file
from hydraulic_interfaces.contract import DRIVE_LIMIT_V
from hydraulic_interfaces.errors import HydraulicError
from hydraulic_sim.model import Model
from hydraulic_sim.model_file import load_model, presets
from hydraulic_sysid.data.bag.recovery import recover
from hydraulic_sysid.data.records import CHANNELS, Record, load_column_map, read_records, to_bag
from hydraulic_sysid.excitation.plan import PLAN_FOLDER, load_plan

from . import must
from .values import anything, number, text

FILES = 10
"""Files in a batch."""

_TOKENS = (
    "nan", ".inf", "-.inf", "1e999", "-1", "0", "1" + 400 * "0", "true", "null", "[]", "{}", "[[[[", "}}}}", "- - -",
    '"\\0"', "&a [*a]", "&a {x: *a}", "!!python/object/apply:os.system [id]", "!!binary aGk=", "2001-01-01",
    "? x", "|", ">-",
    "<<: *b", "é", "\t", "\r", "\x00", "\x85", "​", "0x10", "0o7", "1_000", "~", "12.5 in^2", "5 kg**99999", "m" * 5000,
    "[" * 1200, "{a: " * 1200, "1 m**-1", "1e400 Pa", "1 m/0", "offset_pa",
    "[&a [0,0], &b [*a,*a,*a,*a], &c [*b,*b,*b,*b]]",
)  # fmt: skip


def damaged(rng: random.Random, source: str) -> bytes:
    """A text file with one to four changes: of lines, of words, of bytes."""
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        lines = source.split("\n")
        at = rng.randrange(len(lines))
        kind = rng.randrange(7)
        if kind == 0:
            del lines[at]
        elif kind == 1:
            lines.insert(at, lines[rng.randrange(len(lines))])
        elif kind == 2:
            other = rng.randrange(len(lines))
            lines[at], lines[other] = lines[other], lines[at]
        elif kind == 3:
            lines[at] = " " * rng.randrange(6) + lines[at].strip()
        else:
            words = lines[at].split(" ")
            words[rng.randrange(len(words))] = rng.choice((rng.choice(_TOKENS), repr(anything(rng)), str(number(rng))))
            lines[at] = " ".join(words)
        source = "\n".join(lines)
    data = source.encode("utf-8", "surrogatepass")
    if rng.random() < 0.1:
        at = rng.randrange(len(data) + 1)
        data = data[:at] + rng.randbytes(rng.randrange(1, 5)) + data[at + rng.randrange(8) :]
    return data[: rng.randrange(len(data) + 1)] if rng.random() < 0.03 else data


def _read(path: Path, data: bytes, read: Callable[[Path], object]) -> object | None:
    """What is read, or None where the file is refused; the refusal names it and is short."""
    path.write_bytes(data)
    try:
        return read(path)
    except HydraulicError as error:
        told = str(error)
        must(path.name in told or path.stem in told, f"the error does not name the file: {told[:300]}")
        must(len(told) < 20_000, f"an error of {len(told)} characters")
        return None


@lru_cache
def _sources(folder: Path) -> list[str]:
    return [path.read_text(encoding="utf-8") for path in sorted(folder.glob("*.yaml"))]


def bus_files(rng: random.Random, folder: Path) -> int:
    """Bus files: those that are read keep the drive, the watches and the braking within bounds."""
    for _ in range(FILES):
        bus = _read(folder / "bus.yaml", damaged(rng, rng.choice(_sources(bus_file.SHIPPED))), bus_file.load_bus)
        if bus is not None:
            limit = bus.limits.drive  # type: ignore[attr-defined]
            must(0.0 < limit <= DRIVE_LIMIT_V, f"a bus file with a drive limit of {limit} V is read")
            must(0.0 < LONGEST_LOSS_S < math.inf, "no bound on how long a lost driver may go unnoticed")
    return FILES


def model_files(rng: random.Random, folder: Path) -> int:
    """Model files: every value of those that are read is finite and within the library's bounds."""
    sources = [path.read_text(encoding="utf-8") for path in presets().values()]
    for _ in range(FILES):
        source = rng.choice(sources)
        if rng.random() < 0.2:
            source += f"user_effects: [{rng.choice((text(rng), '/etc/passwd', '../x.py', 'x.py'))!r}]\n"
        model = _read(folder / "model.yaml", damaged(rng, source), load_model)
        if isinstance(model, Model):
            for key in model.keys():  # noqa: SIM118 - a model is no mapping
                low, high = model.parameter(key).bounds
                must(low <= model.value(key) <= high, f"{key} is {model.value(key)}")
    return FILES


_COLUMNS = """\
time: {column: time_s, unit: s}
channels:
  drive: {column: u, unit: V, scale: 1.0}
  position:
    column: 2
    unit: mm
    scale: -1
header: 1
delimiter: ','
"""


def column_maps(rng: random.Random, folder: Path) -> int:
    """Column maps."""
    for _ in range(FILES):
        _read(folder / "columns.yaml", damaged(rng, _COLUMNS), load_column_map)
    return FILES


def gains(rng: random.Random, folder: Path) -> int:
    """Parameter files of the controller."""
    for _ in range(FILES):
        _read(folder / "gains.yaml", damaged(rng, rng.choice(_sources(gains_file.FOLDER))), gains_file.load)
    return FILES


def plans(rng: random.Random, folder: Path) -> int:
    """Excitation plans: what is read plays a drive within its own limit."""
    for number_ in range(FILES):
        plan = _read(folder / "plan.yaml", damaged(rng, rng.choice(_sources(PLAN_FOLDER))), load_plan)
        if plan is not None and number_ == 0 and (plan.duration or 100.0) * plan.rate < 1e5:  # type: ignore[attr-defined]
            try:
                drive = np.asarray(plan.open_loop)  # type: ignore[attr-defined]
            except HydraulicError:
                continue
            limit = plan.amplitude_limit  # type: ignore[attr-defined]
            must(np.isfinite(drive).all() and np.abs(drive).max() <= limit + 1e-9, "a plan beyond its own limit")
    return FILES


_CSV = "\n".join(
    ["time_s,drive_V,position_mm,pressure_a_bar"]
    + [f"{0.001 * k:.9g},{0.5 * (k % 7):g},{0.01 * k:.9g},{70 + k:.9g}" for k in range(30)]
)


def csv_files(rng: random.Random, folder: Path) -> int:
    """CSV files: a record of finite numbers, or an error with the place."""
    for _ in range(5 * FILES):
        data = damaged(rng, _CSV).replace(b" ", rng.choice((b" ", b",", b"")))
        packed = rng.random() < 0.2
        if packed:
            data = gzip.compress(data, 1)
            data = data[: rng.randrange(len(data))] if rng.random() < 0.5 else data
        records = _read(folder / ("r.csv.gz" if packed else "r.csv"), data, read_records)
        _check_records(records)
    return 5 * FILES


def _check_records(records: object) -> None:
    for record in records or ():  # type: ignore[attr-defined]
        must(set(record.channels) <= set(CHANNELS), f"channels {sorted(record.channels)}")
        must(all(np.isfinite(values).all() for values in record.channels.values()), "numbers that are not finite")


def bags(rng: random.Random, folder: Path) -> int:
    """Bags with damaged files: read, or refused; recovered, or refused, without a message that was not there."""
    whole = folder / "whole"
    if not whole.exists():
        time = np.arange(400) * 1e-3
        drive = np.sin(20.0 * time)
        channels = {"drive": drive, "position": 0.01 * drive, "velocity": 0.2 * np.cos(20.0 * time)}
        to_bag(Record("whole", time, 1e-3, channels), whole)
    count = len(read_records(whole)[0])
    for _ in range(FILES // 5):
        broken = folder / "broken"
        shutil.rmtree(broken, ignore_errors=True)
        shutil.copytree(whole, broken)
        file = rng.choice([*broken.glob("*.mcap"), *broken.iterdir()])
        data = bytearray(file.read_bytes())
        for _ in range(rng.choice((1, 1, 3, 20))):
            at = rng.randrange(len(data))
            data[at : at + rng.choice((0, 1, 1, 4))] = rng.randbytes(rng.choice((0, 1, 1, 4)))
        if rng.random() < 0.3:
            data = data[: rng.randrange(len(data))]
        file.write_bytes(data)
        for act in (read_records, lambda path: recover(path), read_records):
            try:
                found = act(broken)
            except HydraulicError as error:
                must("broken" in str(error), f"the error does not name the bag: {str(error)[:300]}")
                continue
            if act is read_records:
                _check_records(found)
                must(all(len(record) <= count for record in found), "more samples than were recorded")  # type: ignore[attr-defined]
    return FILES // 5
