"""Records from outside: their files come in one by one, are looked at, get a column map, and join the list."""

from __future__ import annotations

import asyncio
import shutil
from collections.abc import AsyncIterator
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

from hydraulic_node_utils.whole_file import write_text
from hydraulic_workbench.errors import TooLargeError, UnknownError, WorkbenchError
from hydraulic_workbench.folder import Folder, checked_name
from hydraulic_workbench.library import Entry, Library
from hydraulic_workbench.reading import tables
from hydraulic_workbench.workers import Workers

LARGEST = 2 << 30  # bytes of one upload
MOST_FILES = 100
_BAG_FILES = (".mcap", ".db3")


@dataclass
class Upload:
    """One upload: a folder of files that have come so far."""

    id: str
    name: str
    folder: Path
    size: int = 0

    @property
    def files(self) -> list[Path]:
        """Those that are whole."""
        return sorted(p for p in self.folder.rglob("*") if p.is_file() and not p.name.startswith("."))

    @property
    def content(self) -> Path:
        """The record in it: the one table, or the folder of a bag.

        :raises WorkbenchError: neither is there, or several are.
        """
        files = self.files
        bags = {p.parent for p in files if p.suffix in _BAG_FILES or p.name == "metadata.yaml"}
        others = [p for p in files if p.parent not in bags and p.suffix not in (".yaml", ".yml")]
        if len(bags) + len(others) != 1:
            raise WorkbenchError(f"one table or one bag is needed; there are {len(others)} and {len(bags)}", "file")
        return bags.pop() if bags else others[0]


class Uploads:
    """All that have not become records yet."""

    def __init__(self, folder: Folder, workers: Workers, library: Library) -> None:
        self._folder, self._workers, self._library = folder, workers, library
        self._uploads: dict[str, Upload] = {}
        self._count = 0

    def __getitem__(self, identifier: str) -> Upload:
        """:raises UnknownError: there is none."""
        if identifier not in self._uploads:
            raise UnknownError(f"there is no upload {identifier!r}", "upload")
        return self._uploads[identifier]

    def begin(self, name: Any) -> Upload:
        """A new one."""
        self._count += 1
        text = checked_name(name, "name")
        folder = self._folder.new(self._folder.uploads, text)
        folder.mkdir()
        upload = Upload(f"up-{self._count}", text, folder)
        self._uploads[upload.id] = upload
        return upload

    async def take(self, upload: Upload, place: str, content: AsyncIterator[bytes]) -> None:
        """One file, at a relative path; it is there once it is whole.

        :raises TooLargeError: more than the server takes.
        """
        path = PurePosixPath(place)
        if path.is_absolute() or not 1 <= len(path.parts) <= 3:
            raise WorkbenchError(f"{place!r} is no place in an upload", "file")
        parts = [checked_name(part, "file") for part in path.parts]
        if len(upload.files) >= MOST_FILES:
            raise TooLargeError(f"more than {MOST_FILES} files in one upload")
        target = upload.folder.joinpath(*parts)
        target.parent.mkdir(parents=True, exist_ok=True)
        draft = target.with_name(f".{target.name}.part")
        with draft.open("wb") as stream:
            async for chunk in content:
                upload.size += len(chunk)
                if upload.size > LARGEST:
                    raise TooLargeError(f"more than {LARGEST >> 30} GiB in one upload")
                await asyncio.to_thread(stream.write, chunk)
        draft.replace(target)

    async def preview(self, upload: Upload, columns: Any) -> dict[str, Any]:
        """What is in it, and what a column map makes of it."""
        content = upload.content
        if content.is_dir():
            return await self._workers.run(tables.preview_bag, content)
        return await self._workers.run(tables.preview, content, columns)

    async def finish(self, upload: Upload, columns: Any, name: Any) -> tuple[Entry, Path | None]:
        """Make it a record, with its column map beside it.

        :raises WorkbenchError: it cannot be read so.
        """
        found = await self.preview(upload, columns)
        if found["problem"] or found["record"] is None:
            raise WorkbenchError(found["problem"] or "a column map is needed: say which column is which", "columns")
        content = upload.content
        wanted = checked_name(name, "name") if name else upload.name
        suffix = "" if content.is_dir() else "".join(content.suffixes)
        target = self._folder.new(self._folder.records, wanted.removesuffix(suffix) + suffix)
        await asyncio.to_thread(shutil.move, str(content), target)
        map_file = None
        if columns is not None and not target.is_dir():
            map_file = target.with_name(f"{target.name.removesuffix(suffix)}.columns.yaml")
            await asyncio.to_thread(write_text, map_file, found["yaml"], overwrite=False)
        self.drop(upload)
        return await self._library.add_record(target, "imported", map_file), map_file

    def drop(self, upload: Upload) -> None:
        """Forget it and what has come of it."""
        self._uploads.pop(upload.id, None)
        shutil.rmtree(upload.folder, ignore_errors=True)
