"""Where compiled physics is kept when the user's own folder cannot be written to."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from hydraulic_node_utils import generated_code


@pytest.fixture(name="place")
def temporary_folder_only(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The folder of temporary files, where there is no usable cache folder."""
    blocked = tmp_path / "file"
    blocked.touch()
    monkeypatch.delenv(generated_code.CACHE_VARIABLE, raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(blocked))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    generated_code.temporary_root.cache_clear()
    yield tmp_path
    generated_code.temporary_root.cache_clear()


def test_every_user_has_a_folder_of_their_own(place: Path) -> None:
    root = generated_code.cache_root()
    assert root == place / f"hydraulic_sim-{os.getuid()}"
    assert root.stat().st_mode & 0o777 == 0o700
    assert generated_code.cache_root() == root


def test_a_folder_that_others_can_write_to_is_not_used(place: Path) -> None:
    taken = place / f"hydraulic_sim-{os.getuid()}"
    taken.mkdir()
    taken.chmod(0o777)
    root = generated_code.cache_root()
    assert root != taken and root.parent == place
    assert root.stat().st_mode & 0o777 == 0o700
