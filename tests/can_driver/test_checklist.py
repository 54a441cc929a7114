"""The checklist of a first power-on: made of the bus file, and nothing else."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from hydraulic_can_driver.bus_file import load_bus
from hydraulic_can_driver.checklist import checklist, warnings
from hydraulic_can_driver.supervision import bus_load, frame_bits
from hydraulic_can_driver.verbs import checklist as verb

BUS = load_bus("bench")


def test_it_has_the_numbers_of_the_bus_file() -> None:
    text = checklist(BUS)
    for node in BUS.nodes.values():
        assert f"`{node.name}`" in text
        assert f"0x{node.id:02X} ({node.id})" in text
        for pdo in (*node.receive, *node.transmit):
            assert f"0x{pdo.cob_id:03X}" in text
        for reading in node.inspect:
            assert f"{reading.address} {reading.name}" in text
    assert "bitrate 1000000" in text
    assert "710#00, 720#00, 730#00, 731#00, 732#00" in text
    assert "limit switch retracted (0x6401:1 of `lvdt`) closes at -0.761 m" in text
    assert "0.2 V (328 counts)" in text
    assert "vendor 0x28" in text


def test_another_file_gives_another_list() -> None:
    valve = replace(BUS.valve, id=0x11, heartbeat=0.0)
    text = checklist(replace(BUS, nodes={**BUS.nodes, "valve": valve}, bitrate=250_000, channel="can3", rate=100.0))
    assert "ip link set can3 up type can bitrate 250000" in text
    assert "0x11 (17) | none" in text
    assert "711#00" in text
    assert "at 100 Hz" in text


def test_bits_of_the_longest_and_the_shortest_frame() -> None:
    assert frame_bits(8) == 135  # 111 and 24 stuff bits
    assert frame_bits(0) == 55


def test_load_grows_with_the_rate_and_is_warned_of() -> None:
    assert bus_load(replace(BUS, rate=1000.0), worst=True) == pytest.approx(2.0 * bus_load(BUS, worst=True), rel=0.05)
    assert 0.25 < bus_load(BUS, worst=True) < 0.4
    slow = replace(BUS, bitrate=250_000)
    assert any("loaded" in line for line in warnings(slow))
    assert not any("loaded" in line for line in warnings(BUS))


def test_what_is_not_watched_is_warned_of() -> None:
    found = " ".join(warnings(BUS))
    assert "`lvdt`: no identity" in found
    assert "`valve`" not in found
    deaf = replace(BUS.valve, receive=(replace(BUS.drive_pdo, timeout=0.0),))
    assert "missing set-points" in " ".join(warnings(replace(BUS, nodes={**BUS.nodes, "valve": deaf})))
    blind = {name: node for name, node in BUS.nodes.items() if name not in ("lvdt", "pressure_supply")}
    found = " ".join(warnings(replace(BUS, nodes=blind)))
    assert "No limit switches" in found
    assert "No supply pressure" in found
    braking = BUS.limits.braking
    assert braking is not None and "Braking" not in " ".join(warnings(BUS))
    hasty = replace(BUS, limits=replace(BUS.limits, braking=replace(braking, reaction=0.05)))
    assert "Braking reckons with 0.05 s of reaction, the valve goes on for up to 0.1 s" in " ".join(warnings(hasty))
    assert "No braking" in " ".join(warnings(replace(BUS, limits=replace(BUS.limits, braking=None))))


def test_verb(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert verb.main([]) == 0
    printed = capsys.readouterr().out
    assert printed == checklist(BUS)
    assert verb.main(["--out", str(tmp_path / "list.md")]) == 0
    assert (tmp_path / "list.md").read_text(encoding="utf-8") == printed
    assert verb.main(["--out", str(tmp_path / "list.md")]) == 2
    assert "exists" in capsys.readouterr().err
    assert verb.main(["--bus", "nowhere.yaml"]) == 2
    assert "nowhere.yaml" in capsys.readouterr().err
