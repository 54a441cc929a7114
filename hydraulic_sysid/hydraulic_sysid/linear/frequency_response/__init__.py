"""Frequency responses: empirical transfer function, Welch with coherence, best linear approximation."""

from hydraulic_sysid.linear.errors import FrequencyResponseError
from hydraulic_sysid.linear.frequency_response.bla import BestLinearApproximation, best_linear_approximation
from hydraulic_sysid.linear.frequency_response.periodic import Periods, periods_of
from hydraulic_sysid.linear.frequency_response.spectral import Spectral, etfe, welch

__all__ = [
    "BestLinearApproximation",
    "FrequencyResponseError",
    "Periods",
    "Spectral",
    "best_linear_approximation",
    "etfe",
    "periods_of",
    "welch",
]
