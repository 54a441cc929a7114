"""Frequency responses: empirical transfer function, Welch with coherence, best linear approximation."""

from hydraulic_sysid.linear.errors import FrequencyResponseError
from hydraulic_sysid.linear.frequency_response.bla import best_linear_approximation
from hydraulic_sysid.linear.frequency_response.periodic import periods_of
from hydraulic_sysid.linear.frequency_response.spectral import etfe, welch

__all__ = [
    "FrequencyResponseError",
    "best_linear_approximation",
    "etfe",
    "periods_of",
    "welch",
]
