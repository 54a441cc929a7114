"""From measurement to missing physics: which effect of the library a model lacks.

`holdout` splits records, `linearisation` is a fitted model with its sensitivities, `score_test` predicts what each
candidate explains, `frozen_jacobian` refits the best. The search stands in layers, each of which knows those before it
alone: `fitting`, `candidate_fits`, `data_sheet_fits`, `recording_fits`, and `search`, which adds, leaves out and
exchanges effects. `competing_models` asks what else could be meant, `verdict` decides, `posterior` says how probable
each explanation is, `nonparametric_curves` draws what no effect explains and `unknown_inputs` asks where it acts, which
`whereabouts` puts together, `document` gathers the figures.
"""

from .addition import Addition, add
from .diagnosis import Diagnosis, diagnose
from .errors import DiagnosisError

__all__ = ["Addition", "Diagnosis", "DiagnosisError", "add", "diagnose"]
