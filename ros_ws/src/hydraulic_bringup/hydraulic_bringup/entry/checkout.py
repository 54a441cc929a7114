"""Where things are in a checkout of the project."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Checkout:
    """Paths of one checkout, all below `root`."""

    root: Path

    @classmethod
    def of_this_file(cls) -> Checkout:
        """The checkout this source file lies in."""
        return cls(Path(__file__).resolve().parents[5])

    @property
    def pyproject(self) -> Path:
        """File with the dependency pins."""
        return self.root / "pyproject.toml"

    @property
    def venv(self) -> Path:
        """The virtual environment."""
        return self.root / ".venv"

    @property
    def python(self) -> Path:
        """Interpreter of the virtual environment."""
        return self.venv / "bin" / "python"

    @property
    def workspace(self) -> Path:
        """The colcon workspace."""
        return self.root / "ros_ws"

    @property
    def install(self) -> Path:
        """Where colcon installs the packages."""
        return self.workspace / "install"

    @property
    def logs(self) -> Path:
        """Where the output of every set-up step is kept."""
        return self.workspace / "log" / "bench"

    def packages(self) -> dict[str, Path]:
        """Source folder of every package of the workspace, by name (links resolved)."""
        found = sorted((self.workspace / "src").glob("*/package.xml"))
        return {manifest.parent.name: manifest.parent.resolve() for manifest in found}
