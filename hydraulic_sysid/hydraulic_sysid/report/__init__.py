"""One self-contained HTML page for the results of a run; every figure on it comes from the JSON documents.

A kind of result is shown by a folder here, named after its verb, and nothing else lists the kinds:

``__init__.py``
    One line that says what it is, and ``SCHEMA``, the version of the document that the template reads.
``section.html.j2``
    ``{% extends "result.html.j2" %}`` and its blocks: ``kind``, ``title``, ``lead`` (the heading), ``cards``,
    ``proof`` (the plot that bears the verdict out), ``next`` (what to do, as ``<li>``) and ``more`` (the rest, folded).
    It sees ``result``, the document, and ``figures``, the module beside it; ``macros.html.j2`` holds what
    templates share. Numbers pass ``quantity`` or another filter of ``data/display.py``, so that pages show
    engineering units. Everything is escaped; a misspelt key is an error.
``figures.py``
    Functions from the document, or a part of it, to a Plotly figure, made of ``style.Panels``; besides, what a
    template would compute awkwardly.
"""

from .page import render, write_page

__all__ = ["render", "write_page"]
