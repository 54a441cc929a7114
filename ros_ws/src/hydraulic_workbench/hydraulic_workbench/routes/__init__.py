"""What the page may ask: one module for each tab, each with a table of routes over the bench."""

from __future__ import annotations

from aiohttp import web

from hydraulic_workbench.bench import Bench
from hydraulic_workbench.routes import experiment, general, jobs, live, models, plant, records

TABLES = (general, plant, live, experiment, records, models, jobs)


def add_all(app: web.Application, bench: Bench) -> None:
    """Every route of every module."""
    for module in TABLES:
        app.add_routes(module.routes(bench))
