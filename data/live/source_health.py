"""What is wrong with a live source: one finding a part and fault, from when it is found until it is over."""

import logging
from collections.abc import Iterable

from perception.types import Health, HealthFinding, HealthLevel

log = logging.getLogger(__name__)


class SourceHealth:
    """Findings about topics or ports, which one thread reports and another one publishes."""

    def __init__(self) -> None:
        """Start without a finding."""
        self._findings: dict[tuple[str, str], HealthFinding] = {}
        self.parts: tuple[str, ...] = ()
        """Topics or ports in use, of which each has a status."""

    def report(
        self, part: str, fault: str, reason: str, level: HealthLevel = HealthLevel.WARN
    ) -> None:
        """Add a finding, or renew its reason; the log has it once."""
        if (part, fault) not in self._findings:
            log.warning("%s: %s: %s", part, fault, reason)
        self._findings[part, fault] = HealthFinding(part, level, fault, reason)

    def clear(self, parts: Iterable[str], *faults: str) -> None:
        """Remove faults of some parts."""
        for part in parts:
            for fault in faults:
                if self._findings.pop((part, fault), None) is not None:
                    log.info("%s: %s: over", part, fault)

    @property
    def is_ok(self) -> bool:
        """Whether there is no finding."""
        return not self._findings

    @property
    def health(self) -> Health:
        """All findings."""
        return Health.of(self._findings.copy().values())
