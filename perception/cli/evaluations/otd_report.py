"""`trifuse evaluate otd`, below the flags: trackers of one object against labels or exact truth."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from data.derived.challenges import (
    CHALLENGE_DESCRIPTIONS,
    Challenge,
    ChallengeConfig,
    Variations,
    variations,
)
from data.derived.single_object import ObjectSequence
from perception.cli.evaluations.otd_steps import TargetObject, TrackerRun
from perception.evaluation.config import SingleObjectMetricsConfig
from perception.evaluation.single_object.errors import SingleObjectErrors, single_object_errors
from perception.evaluation.single_object.metrics import PROTOCOL_WORDS as METRIC_WORDS
from perception.evaluation.single_object.metrics import SingleObjectMetrics, single_object_metrics
from perception.types import Calibration

PROTOCOL_WORDS = {
    **METRIC_WORDS,
    "challenges": {str(one): words for one, words in CHALLENGE_DESCRIPTIONS.items()},
}


@dataclass(frozen=True)
class OtdProtocol:
    """How trackers of one object are judged.

    Attributes:
        metrics: what counts as right.
        challenges: from where on a variation of the labels is one.
    """

    metrics: SingleObjectMetricsConfig = field(default_factory=SingleObjectMetricsConfig)
    challenges: ChallengeConfig = field(default_factory=ChallengeConfig)


@dataclass(frozen=True)
class ObjectReport:
    """One object, and how every tracker did on it.

    Attributes:
        sequence: which, and in which of the frames at hand.
        labelled: frames in which its place is known.
        total_frames: that the sequence would have were all of its frames at hand.
        variation: how much.
        challenges: which of its variations are.
        errors: by name of the tracker; without those that refused.
        scores: the same.
        refusals: by name of the tracker, why it could not begin.
    """

    sequence: ObjectSequence
    labelled: int
    total_frames: int
    variation: Variations
    challenges: tuple[Challenge, ...]
    errors: Mapping[str, SingleObjectErrors]
    scores: Mapping[str, SingleObjectMetrics]
    refusals: Mapping[str, str]


@dataclass(frozen=True)
class OtdReport:
    """Everything measured.

    Attributes:
        protocol: how.
        trackers: names, in the order asked for.
        objects: that were followed.
    """

    protocol: OtdProtocol
    trackers: tuple[str, ...]
    objects: Sequence[ObjectReport]

    def objects_with(self, challenge: Challenge | None) -> list[ObjectReport]:
        """Return the objects with a challenge, or all."""
        return [one for one in self.objects if challenge is None or challenge in one.challenges]

    def errors_of(
        self, tracker: str, challenge: Challenge | None = None
    ) -> SingleObjectErrors | None:
        """Return all frames of a tracker, or those of objects with a challenge; None of no frames."""
        objects = self.objects_with(challenge)
        parts = [one.errors[tracker] for one in objects if tracker in one.errors]
        return SingleObjectErrors.concatenate(parts) if parts else None

    def scores_of(
        self, tracker: str, challenge: Challenge | None = None
    ) -> SingleObjectMetrics | None:
        """Return what all these frames together come to."""
        errors = self.errors_of(tracker, challenge)
        return None if errors is None else single_object_metrics(errors, self.protocol.metrics)


def evaluate_object(
    target: TargetObject,
    runs: Mapping[str, TrackerRun],
    camera: Calibration | None,
    protocol: OtdProtocol,
) -> ObjectReport:
    """Compare what every tracker answered with the object.

    Args:
        target: the object.
        runs: by name of the tracker, how it did.
        camera: of the drive, or None.
        protocol: how it is judged.
    """
    errors = {
        name: single_object_errors(target.truth, run.track, camera)
        for name, run in runs.items()
        if run.refusal is None
    }
    variation = variations(target.truth)
    return ObjectReport(
        sequence=target.sequence,
        labelled=len(target.truth),
        total_frames=target.total_frames,
        variation=variation,
        challenges=variation.challenges(protocol.challenges),
        errors=errors,
        scores={name: single_object_metrics(one, protocol.metrics) for name, one in errors.items()},
        refusals={name: run.refusal for name, run in runs.items() if run.refusal is not None},
    )
