"""The designed experiment as a plan: a drive in a CSV file, and the plan file that plays it."""

from __future__ import annotations

from io import StringIO
from pathlib import Path

import numpy as np
from ruamel.yaml import YAML

from hydraulic_node_utils.whole_file import write_text
from hydraulic_sysid.excitation import Plan
from hydraulic_sysid.excitation.amplitude import Limits
from hydraulic_sysid.excitation.signals.playback import Playback

from .errors import NextExperimentError
from .reference import Played

NAME = "next_experiment"
TRACKING = 0.08  # of the drive, for what keeps the piston near its predicted way
_BEYOND = 1.1  # of the travel limit, from which on the run is aborted: sensors are noisy
_APPROACH_S = 8.0
_DIGITS = 6
_MOST_GAIN = 1000.0  # V/m


def make(played: Played, limits: Limits, centre: float, rate: float, folder: Path, description: str) -> Plan:
    """The plan that plays a drive; its CSV file is written into ``folder``.

    The plan's centring pulls by k·(x_c − x). As k·(x_p − x_c) is added to the drive, x_p being the predicted position,
    what acts is the drive and a weak pull to the predicted way: the piston of an integrating plant does not drift off.
    """
    gain = min(TRACKING * limits.drive / limits.travel, _MOST_GAIN)
    ahead = gain * (played.trajectory.position - centre)
    drive = np.clip(played.drive + ahead, -limits.drive, limits.drive)
    file = folder / f"{NAME}.csv"
    rows = "".join(f"{k / rate:.{_DIGITS}f},{v:.{_DIGITS}f}\n" for k, v in enumerate(drive.tolist()))
    write_text(file, "time_s,drive_V\n" + rows)
    return Plan(
        name=NAME,
        description=description,
        signal=Playback(file=str(file)),
        travel_limit=_BEYOND * limits.travel,
        rate=rate,
        amplitude_limit=limits.drive,
        fade_in=0.0,
        fade_out=0.0,
        centre=centre,
        centring_gain=gain,
        centring_limit=min(2.0 * TRACKING * limits.drive, limits.drive),
        approach=_APPROACH_S,
    )


def save(plan: Plan, folder: Path) -> Path:
    """Write plan file and drive into a folder, side by side: they may be moved together. Returns the plan file.

    :raises NextExperimentError: one of them exists.
    """
    assert isinstance(plan.signal, Playback)
    file, drive = folder / f"{NAME}.yaml", folder / f"{NAME}.csv"
    for one in (file, drive):
        if one.exists():
            raise NextExperimentError(f"{one} exists; choose another folder (a plan is never overwritten)")
    values = plan.as_mapping()
    values["signal"] = {**values["signal"], "file": drive.name}
    yaml = YAML(typ="safe", pure=True)
    yaml.default_flow_style = False
    yaml.sort_base_mapping_type_on_output = False  # type: ignore[assignment]
    content = StringIO()
    yaml.dump(values, content)
    write_text(drive, drive_text(plan))
    write_text(file, content.getvalue())
    return file


def drive_text(plan: Plan) -> str:
    """The CSV file of a plan's drive, byte for byte."""
    assert isinstance(plan.signal, Playback)
    times, drives = plan.signal._table
    return "time_s,drive_V\n" + "".join(
        f"{t:.{_DIGITS}f},{v:.{_DIGITS}f}\n" for t, v in zip(times.tolist(), drives.tolist(), strict=True)
    )
