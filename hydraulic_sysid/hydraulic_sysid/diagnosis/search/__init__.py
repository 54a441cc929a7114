"""From measurement to missing physics: which effect of the library a model lacks.

`pieces` splits records, `anchor` fits and linearises a model, `screen` predicts what each candidate would gain,
`chord` refits the best, `search` adds, leaves out and exchanges effects, `rivals` asks what else could be meant,
`verdict` decides, `shape` draws what no effect explains, `document` gathers the figures.
"""

from .addition import Addition, add
from .diagnosis import Diagnosis, DiagnosisError, diagnose

__all__ = ["Addition", "Diagnosis", "DiagnosisError", "add", "diagnose"]
