"""Settings of the data that the fusion's network is trained on, and of the sweep of its sizes."""

from dataclasses import dataclass

from data.detections.config import DetectorModelPaths, FusionDataConfig
from perception.errors import UsageError

MODEL = "fusion"  # kind of model in checkpoints and model files
Hidden = tuple[int, ...]
"""Neurons of each hidden layer."""
_MODELS = DetectorModelPaths()


@dataclass(frozen=True)
class SweepConfig:
    """Sizes of the network to try before the training, which takes the best of them (Fig. 7.13).

    Attributes:
        one: Numbers of neurons of one hidden layer.
        two: Numbers of neurons of two hidden layers, of which all falling pairs are tried.
    """

    one: tuple[int, ...] = ()
    two: tuple[int, ...] = ()

    @property
    def sizes(self) -> list[Hidden]:
        """All sizes."""
        pairs = [(first, second) for first in self.two for second in self.two if second < first]
        return [*((size,) for size in self.one), *pairs]


@dataclass(frozen=True)
class FusionRowsConfig(FusionDataConfig):
    """Combinations of the detections in labelled frames, and how they are loaded.

    Attributes:
        models: Model files of the detectors; else those that ship.
        batch_size: Combinations per batch; null takes all at once, as LBFGS and
            LevenbergMarquardt need them.
        corrupted_copies: Copies of each training frame with corrupted detections, for the default variant.
    """

    models: DetectorModelPaths = _MODELS
    batch_size: int | None = None
    corrupted_copies: int = 3

    def __post_init__(self) -> None:
        """Validate the numbers."""
        if (self.batch_size is not None and self.batch_size < 1) or self.corrupted_copies < 0:
            raise UsageError(
                "loading",
                expected="a batch size from 1, or null, and corrupted copies from 0",
                found=f"{self.batch_size} and {self.corrupted_copies}",
            )
