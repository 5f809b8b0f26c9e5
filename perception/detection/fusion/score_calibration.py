"""Score calibration: an increasing curve from the score of a network to the probability that it is correct.

M. Kull, T. Silva Filho, P. Flach, "Beta calibration", AISTATS 2017: the logit of the probability is
a ln s - b ln (1 - s) + c. With a = b = 1 and c = 0, scores stay as they are.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from perception.errors import UsageError
from perception.types import MODALITIES, Float64

_EDGE = 1e-6  # minimum distance of scores from 0 and 1


@dataclass(frozen=True)
class BetaCalibration:
    """A curve that keeps the order of the scores.

    Attributes:
        a: Slope over the logarithm of the score, at least 0.
        b: Slope over the negative logarithm of one minus the score, at least 0.
        c: Offset of the logit.
    """

    a: float = 1.0
    b: float = 1.0
    c: float = 0.0

    def __post_init__(self) -> None:
        """Validate that the curve increases."""
        if not (self.a >= 0 and self.b >= 0 and self.a + self.b > 0 and np.isfinite(self.c)):
            raise UsageError(
                "calibration",
                expected="a and b of at least 0, not both 0, and a finite c",
                found=f"{self}",
            )

    def __str__(self) -> str:
        """Return the curve as text, as in a model file."""
        return f"{self.a!r},{self.b!r},{self.c!r}"

    @classmethod
    def parse(cls, text: str) -> "BetaCalibration":
        """Return the curve of a text; ValueError where it is none."""
        a, b, c = map(float, text.split(","))
        return cls(a, b, c)

    def probabilities(self, scores: Float64) -> Float64:
        """Return the (M,) probabilities that detections with (M,) scores are correct."""
        log_score, log_complement = score_logs(scores)
        return np.asarray(
            1 / (1 + np.exp(-(self.a * log_score + self.b * log_complement + self.c)))
        )


@dataclass(frozen=True)
class FusionCalibration:
    """Calibration curves of a fusion.

    Attributes:
        joint: Curve of the fused scores of every class that has no curve of its own.
        named: Curves by name: of the fused scores of a class, `Car`, or of a class in a set of modalities that were
            searched, `dm+rm:Car`; of the scores of a modality where they are not fused, `rgb`.
    """

    joint: BetaCalibration = BetaCalibration()
    named: Mapping[str, BetaCalibration] = field(default_factory=dict)

    def __str__(self) -> str:
        """Return the curves as text, as in a model file: 1.0,1.0,0.0 dm+rm:Car=1.0,1.0,0.5 rgb=2.0,1.0,0.5."""
        return " ".join([str(self.joint), *(f"{name}={one}" for name, one in self.named.items())])

    @classmethod
    def parse(cls, text: str) -> "FusionCalibration":
        """Return the curves of a text; ValueError where it has none."""
        joint, *others = text.split(" ")
        pairs = (entry.split("=") for entry in others)
        return cls(
            BetaCalibration.parse(joint), {name: BetaCalibration.parse(one) for name, one in pairs}
        )

    def probabilities(self, scores: Float64, names: NDArray[np.str_]) -> Float64:
        """Return the (M,) probabilities of (M,) scores by the curves of (M,) names."""
        found = np.zeros(len(scores))
        for name in np.unique(names).tolist():
            rows = names == name
            found[rows] = self._curve(name).probabilities(scores[rows])
        return found

    def _curve(self, name: str) -> BetaCalibration:
        """Return the curve of a name; of a set without one that of the class."""
        other = BetaCalibration() if name in MODALITIES else self.joint
        return self.named.get(name, self.named.get(name.rpartition(":")[2], other))


def score_logs(scores: Float64) -> tuple[Float64, Float64]:
    """Return the (M,) ln s and -ln (1 - s) of scores, clipped away from 0 and 1."""
    inside = np.clip(scores, _EDGE, 1 - _EDGE)
    return np.log(inside), -np.log1p(-inside)
