"""``python -m hydraulic_sysid VERB …``."""

import sys

from hydraulic_node_utils.cli import run_verb

sys.exit(run_verb("hydraulic_sysid"))
