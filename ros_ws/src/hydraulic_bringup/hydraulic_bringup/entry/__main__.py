"""Start of `./bench`, called by path: `python -ES …/hydraulic_bringup/entry VERB …`."""

import sys
from pathlib import Path

# Python put this folder first, where its modules could shadow others; the folder of the package is meant.
_here = Path(__file__).resolve().parent
sys.path[:] = [str(_here.parents[1]), *(p for p in sys.path if Path(p).resolve() != _here)]

from hydraulic_bringup.entry.cli import main  # noqa: E402

sys.exit(main(sys.argv[1:]))
