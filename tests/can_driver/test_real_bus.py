"""Which buses move something real."""

from __future__ import annotations

from pathlib import Path

import pytest

from hydraulic_can_driver import can_bus
from hydraulic_can_driver.errors import BusDownError


def test_a_group_that_cannot_be_kept_on_this_machine_is_refused() -> None:
    with pytest.raises(BusDownError, match="only IPv4"):
        can_bus.open_can("udp_multicast", "ff15:7079:7468:6f6e:6465:6d6f:6d63:6173")


@pytest.mark.parametrize(
    ("interface", "channel", "programs"),
    [
        ("virtual", "bench", True),
        ("udp_multicast", "239.74.163.2:43113", True),
        ("socketcan", "vcan0", True),
        ("socketcan", "vcan7", False),  # renamed
        ("socketcan", "can0", False),
        ("socketcan", "slcan0", False),
        ("socketcan", "vcan99", False),  # not there
        ("pcan", "PCAN_USBBUS1", False),
        ("slcan", "/dev/ttyACM0", False),
    ],
)
def test_which_buses_have_nothing_but_programs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, interface: str, channel: str, programs: bool
) -> None:
    for name, place in (("vcan0", "virtual"), ("slcan0", "virtual"), ("can0", "pci0/usb1"), ("vcan7", "pci0/usb2")):
        device = tmp_path / "devices" / place / name
        device.mkdir(parents=True)
        (tmp_path / name).symlink_to(device)
    monkeypatch.setattr(can_bus, "_SYSTEM_NETWORK", tmp_path)
    assert can_bus.programs_only(interface, channel) is programs
