"""The workbench for tests of what a page shows and does, not of how fast: others run beside them.

The jobs do not give way to others, and the simulator has an eighth of the usual rate.
"""

from __future__ import annotations

import sys

from hydraulic_workbench import jobs, plant_kinds
from hydraulic_workbench.nodes import workbench

if __name__ == "__main__":
    jobs.NICE = 0
    plant_kinds.SENSORS["rate"] = 125.0
    sys.exit(workbench.main())
