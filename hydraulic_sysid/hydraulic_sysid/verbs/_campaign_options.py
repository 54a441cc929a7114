"""Options of the verbs that spread cases over workers."""

from __future__ import annotations

import argparse

from hydraulic_node_utils import cli
from hydraulic_sysid import campaign


def add_crew_options(parser: argparse.ArgumentParser) -> None:
    """``--workers N`` or ``--scheduler ADDRESS``; read them with `chosen_crew`."""
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--workers", metavar="N", type=int, help="processes (default: one for each processor)")
    where.add_argument("--scheduler", metavar="ADDRESS", help="of a Dask cluster, such as tcp://host:8786")


def chosen_crew(options: argparse.Namespace) -> campaign.Crew:
    """The workers that the command line asks for.

    :raises UsageError: fewer than one.
    :raises CampaignError: a cluster that is not there.
    """
    if options.workers is not None and options.workers < 1:
        raise cli.UsageError(f"--workers is {options.workers}; allowed is 1 or more")
    return campaign.dask_cluster(options.scheduler) if options.scheduler else campaign.processes(options.workers)
