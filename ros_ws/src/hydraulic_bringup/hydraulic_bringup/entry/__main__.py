"""Start of `./bench`, called by path: `python -ES …/hydraulic_bringup/entry VERB …`."""

import sys
from pathlib import Path

# Python put this folder first, where its modules could shadow others; the folder of the package is meant.
_here = Path(__file__).resolve().parent
sys.path[:] = [str(_here.parents[1]), *(p for p in sys.path if Path(p).resolve() != _here)]

from hydraulic_bringup.entry import host  # noqa: E402
from hydraulic_bringup.entry.errors import BenchError  # noqa: E402

try:
    host.check_system(sys.platform)  # before anything is imported that other systems have not
except BenchError as error:
    sys.exit(f"bench: {error}")

from hydraulic_bringup.entry.cli import main  # noqa: E402

sys.exit(main(sys.argv[1:]))
