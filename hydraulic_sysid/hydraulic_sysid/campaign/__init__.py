"""Campaigns: one piece of work over many cases, on processes or on a cluster, that can be killed and resumed.

A `Case` is what one call works on, keyed by the hash of its inputs. `run` gives each case to an executor and keeps
its outcome in a file of its own as soon as there is one; what is kept is not computed again. A case that fails is an
outcome like the others. `verb_cases` makes cases of a verb's calls: records × models × options.
"""

from hydraulic_sysid.campaign.engine import Progress, run
from hydraulic_sysid.campaign.executors import Crew, dask_cluster, processes
from hydraulic_sysid.campaign.manifest import CampaignError, Manifest, load_manifest
from hydraulic_sysid.campaign.outcome import Case, Outcome, digest
from hydraulic_sysid.campaign.verb_case import verb_cases, work

__all__ = [
    "CampaignError",
    "Case",
    "Crew",
    "Manifest",
    "Outcome",
    "Progress",
    "dask_cluster",
    "digest",
    "load_manifest",
    "processes",
    "run",
    "verb_cases",
    "work",
]
