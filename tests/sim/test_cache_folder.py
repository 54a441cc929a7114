"""Where compiled physics is kept, and that of several processes one compiles it."""

from __future__ import annotations

import fcntl
import os
import tempfile
import threading
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


@pytest.mark.parametrize("patience", [60.0, 0.0])
def test_what_another_process_compiles_is_waited_for(
    patience: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """But not for ever: that process may have been stopped."""
    monkeypatch.setenv(generated_code.CACHE_VARIABLE, str(tmp_path))
    monkeypatch.setattr(generated_code, "_PATIENCE_S", patience)
    text, loaded = "NUMBER = 7\n", list[int]()
    folder = generated_code.place("seven", text, ()).parent
    folder.mkdir()

    def load() -> None:
        loaded.append(generated_code.load("seven", text, (), {}).NUMBER)

    with (folder / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        loading = threading.Thread(target=load)
        loading.start()
        loading.join(0.5 if patience else 60.0)
        assert loaded == ([] if patience else [7])
    loading.join(60.0)
    assert loaded == [7]
