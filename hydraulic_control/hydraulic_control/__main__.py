"""``python -m hydraulic_control VERB …``."""

import sys

from hydraulic_node_utils.cli import run_verb

sys.exit(run_verb("hydraulic_control"))
