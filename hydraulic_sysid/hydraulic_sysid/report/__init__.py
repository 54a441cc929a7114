"""One self-contained HTML page for the results of a run; every figure on it comes from the JSON documents."""

from .page import render, write_page

__all__ = ["render", "write_page"]
