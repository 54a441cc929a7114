"""Check a model file against records in seconds, before anything is fitted or searched.

One finding, one function: `units`, `recording`, `experiment`, `travel`, `pressures`, `senses`, `forces`, `flows` and
`identifiability` hold them; `document` calls them in an order in which none judges what an earlier one has refuted.
"""

from .document import check, contradictions, rows, warnings
from .experiment import resonance
from .finding import CONTRADICTION, DOUBTFUL, NOT_IDENTIFIABLE, NOTE, Finding
from .stops import other_stops

__all__ = [
    "CONTRADICTION",
    "DOUBTFUL",
    "NOTE",
    "NOT_IDENTIFIABLE",
    "Finding",
    "check",
    "contradictions",
    "other_stops",
    "resonance",
    "rows",
    "warnings",
]
