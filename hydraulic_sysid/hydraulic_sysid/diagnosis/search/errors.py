"""What can be wrong with a question for what is missing."""

from hydraulic_interfaces.errors import HydraulicError


class DiagnosisError(HydraulicError, ValueError):
    """Records or model do not allow a diagnosis; the message says what is needed."""
