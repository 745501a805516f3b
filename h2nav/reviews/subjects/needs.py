"""What a subject needs to be looked at: each returns why it is missing, or nothing."""

from h2nav.reviews import evidence as parts
from h2nav.reviews.declared import Evidence


def times(evidence: Evidence) -> str:
    """Times of arrival."""
    return "" if evidence.of(parts.has_times) else "no times of arrival"


def imu(evidence: Evidence) -> str:
    """Samples of an IMU."""
    return "" if evidence.of(parts.sampled) else "no IMU"


def armed(evidence: Evidence) -> str:
    """A flight."""
    return "" if evidence.of(parts.recorded).armed else "never armed"


def motors(evidence: Evidence) -> str:
    """Outputs of motors."""
    return "no motor outputs" if evidence.of(parts.recorded).motors is None else ""


def battery(evidence: Evidence) -> str:
    """A battery, or reports of one."""
    return ""


def attitudes(evidence: Evidence) -> str:
    """An attitude of the autopilot, or its lanes."""
    return ""


def compass(evidence: Evidence) -> str:
    """A compass."""
    return ""


def fix(evidence: Evidence) -> str:
    """A receiver."""
    return ""
