"""Check a model file against records in seconds, before anything is fitted or searched.

One finding, one function: `units`, `recording`, `experiment`, `travel`, `pressures`, `senses`, `forces`, `flows` and
`identifiability` hold them; `document` calls them in an order in which none judges what an earlier one has refuted.
"""

from .document import check, contradictions, rows, warnings
from .finding import CONTRADICTION, DOUBTFUL, NOT_IDENTIFIABLE, NOTE, Finding

__all__ = [
    "CONTRADICTION",
    "DOUBTFUL",
    "NOTE",
    "NOT_IDENTIFIABLE",
    "Finding",
    "check",
    "contradictions",
    "rows",
    "warnings",
]
