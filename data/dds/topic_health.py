"""What is wrong with topics: one finding a topic and fault, from when it is found until it is over."""

import logging
from collections.abc import Iterable

from perception.types import Health, HealthFinding, HealthLevel

log = logging.getLogger(__name__)


class TopicHealth:
    """Findings about topics, which one thread reports and another one publishes."""

    def __init__(self) -> None:
        """Start without a finding."""
        self._findings: dict[tuple[str, str], HealthFinding] = {}
        self.topics: tuple[str, ...] = ()
        """Topics in use, of which each has a status."""

    def report(
        self, topic: str, fault: str, reason: str, level: HealthLevel = HealthLevel.WARN
    ) -> None:
        """Add a finding, or renew its reason; the log has it once."""
        if (topic, fault) not in self._findings:
            log.warning("%s: %s: %s", topic, fault, reason)
        self._findings[topic, fault] = HealthFinding(topic, level, fault, reason)

    def clear(self, topics: Iterable[str], *faults: str) -> None:
        """Remove faults of some topics."""
        for topic in topics:
            for fault in faults:
                if self._findings.pop((topic, fault), None) is not None:
                    log.info("%s: %s: over", topic, fault)

    @property
    def is_ok(self) -> bool:
        """Whether there is no finding."""
        return not self._findings

    @property
    def health(self) -> Health:
        """All findings."""
        return Health.of(self._findings.copy().values())
