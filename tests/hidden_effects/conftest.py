"""The benches are a package of their own beside the tests, so that benchmarks can use it as well."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
