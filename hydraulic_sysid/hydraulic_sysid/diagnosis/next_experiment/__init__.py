"""The next experiment: the excitation on which competing models disagree most, each refitted as well as it can be.

`movements` lists what an experiment may be made of, `reference` turns movements into a drive, `evidence` says how
much each would show, `movement_search` finds the best sequence, `verify` plays it on every model and refits them,
`plan_file` writes it for the excitation node, `document` gathers the figures.
"""

from hydraulic_sysid.excitation.amplitude import Limits

from .errors import NextExperimentError
from .proposal import Proposal, limits_of, next_experiment

__all__ = ["Limits", "NextExperimentError", "Proposal", "limits_of", "next_experiment"]
