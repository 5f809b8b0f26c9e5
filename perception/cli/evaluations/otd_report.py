"""`trifuse evaluate otd`, below the flags: trackers of one object against labels or exact truth."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from data.derived.challenges import (
    CHALLENGE_WORDS,
    Challenge,
    ChallengeRule,
    Variations,
    variations,
)
from data.derived.single_object import ObjectSequence
from perception.cli.evaluations.otd_steps import Following, ObjectToFollow
from perception.evaluation.single_object.curves import FollowRule
from perception.evaluation.single_object.errors import FollowErrors, follow_errors
from perception.evaluation.single_object.scores import PROTOCOL_WORDS as FOLLOW_WORDS
from perception.evaluation.single_object.scores import FollowScores, score_errors
from perception.types import Calibration

PROTOCOL_WORDS = {
    **FOLLOW_WORDS,
    "challenges": {str(one): words for one, words in CHALLENGE_WORDS.items()},
}


@dataclass(frozen=True)
class OtdProtocol:
    """How trackers of one object are judged.

    Attributes:
        follow: what counts as right.
        challenges: from where on a variation of the labels is one.
    """

    follow: FollowRule = field(default_factory=FollowRule)
    challenges: ChallengeRule = field(default_factory=ChallengeRule)


@dataclass(frozen=True)
class ObjectReport:
    """One object, and how every tracker did on it.

    Attributes:
        sequence: which, and in which of the frames at hand.
        labelled: frames in which its place is known.
        whole_frames: that the sequence would have were all of its frames at hand.
        varies: how much.
        challenges: which of its variations are.
        errors: by name of the tracker; without those that refused.
        scores: the same.
        refusals: by name of the tracker, why it could not begin.
    """

    sequence: ObjectSequence
    labelled: int
    whole_frames: int
    varies: Variations
    challenges: tuple[Challenge, ...]
    errors: Mapping[str, FollowErrors]
    scores: Mapping[str, FollowScores]
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

    def errors_of(self, tracker: str, challenge: Challenge | None = None) -> FollowErrors | None:
        """Return all frames of a tracker, or those of objects with a challenge; None of no frames."""
        objects = self.objects_with(challenge)
        parts = [one.errors[tracker] for one in objects if tracker in one.errors]
        return FollowErrors.concatenate(parts) if parts else None

    def scores_of(self, tracker: str, challenge: Challenge | None = None) -> FollowScores | None:
        """Return what all these frames together come to."""
        errors = self.errors_of(tracker, challenge)
        return None if errors is None else score_errors(errors, self.protocol.follow)


def judge_object(
    wanted: ObjectToFollow,
    followings: Mapping[str, Following],
    camera: Calibration | None,
    protocol: OtdProtocol,
) -> ObjectReport:
    """Compare what every tracker answered with the object.

    Args:
        wanted: the object.
        followings: by name of the tracker, how it did.
        camera: of the drive, or None.
        protocol: how it is judged.
    """
    errors = {
        name: follow_errors(wanted.truth, following.track, camera)
        for name, following in followings.items()
        if following.refusal is None
    }
    varies = variations(wanted.truth)
    return ObjectReport(
        sequence=wanted.sequence,
        labelled=len(wanted.truth),
        whole_frames=wanted.whole_frames,
        varies=varies,
        challenges=varies.challenges(protocol.challenges),
        errors=errors,
        scores={name: score_errors(one, protocol.follow) for name, one in errors.items()},
        refusals={
            name: following.refusal
            for name, following in followings.items()
            if following.refusal is not None
        },
    )
