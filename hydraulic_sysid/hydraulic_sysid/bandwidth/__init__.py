"""The actuator's bandwidth: from a model file, or from the record of a probe."""

from hydraulic_sysid.bandwidth.definition import GAIN_SHARE, Bandwidth, BandwidthError, from_response
from hydraulic_sysid.bandwidth.document import document, from_model, from_record, from_rehearsal

__all__ = [
    "GAIN_SHARE",
    "Bandwidth",
    "BandwidthError",
    "document",
    "from_model",
    "from_record",
    "from_rehearsal",
    "from_response",
]
