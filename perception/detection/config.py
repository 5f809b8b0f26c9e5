"""Configuration of the vehicle detectors: networks, proposals, suppression, fusion and score thresholds.

Two thresholds on scores hold for all detectors and for what is made of their detections:

    min_score       below it a detector reports nothing; low, since a precision-recall curve needs the whole range
    display_score   from it on a detection is drawn, and counted as a vehicle in summaries
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

from perception.errors import UsageError
from perception.types import DETECTOR_MODALITIES, DetectorModality, Method

_SMALLEST_CELL_M = 0.05

# Input of the fusion network: scores alone, the thesis' 23 features, or all features.
FusionVariant = Literal["scores", "features", "default"]


def _given(overrides: object) -> dict[str, Any]:
    return {name: value for name, value in vars(overrides).items() if value is not None}


@dataclass(frozen=True)
class ProposalOverrides:
    """Vehicle proposals of DepthCN: those of the four parameters of the thesis' joint search (6.1.4) that are given.

    Attributes:
        cell_m: Edge of a cell of the ground removal in metres, υ; else that of the network's method.
        min_variance_m2: Variance of the heights in a cell below which the cell is ground, in square metres, δ.
            The default method removes the points within three such deviations of the lowest one around.
        min_points: Number of points within the radius that make a point a core of a DBSCAN cluster, η.
        radius_m: Radius of DBSCAN's neighbourhood in metres, ε; of the default method at the sensor.
    """

    cell_m: float | None = None
    min_variance_m2: float | None = None
    min_points: int | None = None
    radius_m: float | None = None

    def __post_init__(self) -> None:
        """Validate the ranges of those that are given."""
        self.over(ProposalConfig())

    def over(self, config: "ProposalConfig") -> "ProposalConfig":
        """Return a configuration with the parameters that are given."""
        return replace(config, **_given(self))


@dataclass(frozen=True)
class ProposalConfig(ProposalOverrides):
    """All four parameters of the proposals.

    The values are those of the author's code, but for the radius: the default method grows it with the range,
    and its search prefers a smaller one. `PROPOSAL_CONFIGS` holds the values of each method.
    """

    cell_m: float = 0.5
    min_variance_m2: float = 0.01
    min_points: int = 5
    radius_m: float = 0.3

    def __post_init__(self) -> None:
        """Validate the ranges."""
        is_ground_valid = self.cell_m >= _SMALLEST_CELL_M and self.min_variance_m2 >= 0
        if not (is_ground_valid and self.radius_m > 0 and self.min_points > 0):
            raise UsageError(
                "proposals",
                expected=f"a cell of at least {_SMALLEST_CELL_M:g} m, a variance of at least 0 m², "
                "and a radius and number of points above 0",
                found=f"{self.cell_m:g} m, {self.min_variance_m2:g} m², {self.radius_m:g} m, "
                f"{self.min_points}",
            )


PROPOSAL_CONFIGS: Mapping[Method, ProposalConfig] = {
    "default": ProposalConfig(),
    "thesis": ProposalConfig(radius_m=0.5),
}


@dataclass(frozen=True)
class NmsConfig:
    """Score threshold and non-maximum suppression, the same for all detectors (6.2.4).

    Attributes:
        min_score: Score below which a detector reports nothing, 0 to 1.
        max_iou: Overlap (IoU) with a better detection of the same class above which a detection is suppressed;
            a DepthCN network of the thesis suppresses none.
    """

    min_score: float = 0.01
    max_iou: float = 0.5

    def __post_init__(self) -> None:
        """Validate the ranges."""
        if not (0 <= self.min_score <= 1 and 0 < self.max_iou <= 1):
            raise UsageError(
                "non-maximum suppression",
                expected="min_score and max_iou from 0 to 1, max_iou above 0",
                found=f"{self.min_score:g} and {self.max_iou:g}",
            )


DEFAULT_NMS = NmsConfig()


@dataclass(frozen=True)
class DepthCnConfig:
    """DepthCN: LiDAR proposals that a network verifies (6.1).

    Attributes:
        enabled: Whether DepthCN runs; else as the method of detection says.
        model: ONNX file of another network than the one of this package.
        proposals: Proposal parameters in place of those of the network's method.
    """

    enabled: bool | None = None
    model: Path | None = None
    proposals: ProposalOverrides = field(default_factory=ProposalOverrides)

    def __post_init__(self) -> None:
        """Take the name of a file as its path."""
        _take_as_paths(self, "model")


@dataclass(frozen=True)
class TriBoxOverrides:
    """Combinations of one box of each modality, tri-boxes (6.2.4): those parameters that are given.

    Attributes:
        min_iou: Overlap (IoU) above which two boxes may show the same object; else as the network was trained.
        by_set: Combine all boxes of a set that overlaps connect, as the thesis does; else only boxes that
            overlap each other. No effect on the default fusion, which matches boxes one to one.
        max_partners: Number of boxes of each other modality that a box is combined with, those of the
            largest overlap; 0 for all. No effect on the default fusion either.
    """

    min_iou: float | None = None
    by_set: bool | None = None
    max_partners: int | None = None

    def __post_init__(self) -> None:
        """Validate the ranges of those that are given."""
        self.over(TriBoxConfig())

    def over(self, config: "TriBoxConfig") -> "TriBoxConfig":
        """Return a configuration with the parameters that are given."""
        return replace(config, **_given(self))


@dataclass(frozen=True)
class TriBoxConfig(TriBoxOverrides):
    """All parameters of tri-boxes; `TRI_BOX_CONFIGS` holds those of each variant of the fusion network."""

    min_iou: float = 0.0
    by_set: bool = True
    max_partners: int = 4

    def __post_init__(self) -> None:
        """Validate the ranges."""
        if not (0 <= self.min_iou < 1 and self.max_partners >= 0):
            raise UsageError(
                "tri-boxes",
                expected="min_iou from 0 to below 1 and max_partners from 0",
                found=f"{self.min_iou:g} and {self.max_partners}",
            )


TRI_BOX_CONFIGS: Mapping[FusionVariant, TriBoxConfig] = {
    "scores": TriBoxConfig(),
    "features": TriBoxConfig(),
    "default": TriBoxConfig(min_iou=0.4, by_set=False, max_partners=1),
}


def tri_box_config(variant: FusionVariant, max_partners: int | None = None) -> TriBoxConfig:
    """Return the combinations of a variant, with another number of partners where it is given."""
    return TriBoxOverrides(max_partners=max_partners).over(TRI_BOX_CONFIGS[variant])


@dataclass(frozen=True)
class DetectionConfig:
    """Detectors that run on each frame.

    Attributes:
        modalities: Modalities to detect in and fuse: rgb (image), dm (depth map), rm (reflectance map),
            bev (scan from above); an empty list for none; else those of the method, and those whose file is named.
        rgb_model: ONNX file of another image detector than the one of this package.
        dm_model: ONNX file of another depth map detector.
        rm_model: ONNX file of another reflectance map detector.
        bev_model: ONNX file of another detector of the bird's-eye view.
        fusion_model: ONNX file of another fusion network of the modalities (6.2.4).
        depthcn: DepthCN, the LiDAR detector.
        tri_boxes: Combinations of boxes in place of those that the fusion was trained with.
        nms: Score threshold and suppression of every detector and of the fusion.
        display_score: Score from which a detection is drawn, and counted as a vehicle in summaries, 0 to 1.
        method: The thesis detects in rgb, dm and rm, and by DepthCN; the default so without DepthCN from 64 beams on, and in
            rgb and bev of fewer; else that of the pipeline.
    """

    modalities: tuple[DetectorModality, ...] | None = None
    rgb_model: Path | None = None
    dm_model: Path | None = None
    rm_model: Path | None = None
    bev_model: Path | None = None
    fusion_model: Path | None = None
    depthcn: DepthCnConfig = field(default_factory=DepthCnConfig)
    tri_boxes: TriBoxOverrides = field(default_factory=TriBoxOverrides)
    nms: NmsConfig = field(default_factory=NmsConfig)
    display_score: float = 0.5
    method: Method | None = None

    def __post_init__(self) -> None:
        """Validate modalities and display score; take names of files as paths."""
        _take_as_paths(self, "rgb_model", "dm_model", "rm_model", "bev_model", "fusion_model")
        if self.modalities is not None and len(set(self.modalities)) < len(self.modalities):
            raise UsageError(
                "modalities",
                expected=f"some of {', '.join(DETECTOR_MODALITIES)}, each once",
                found=", ".join(self.modalities),
            )
        if not 0 <= self.display_score <= 1:
            raise UsageError(
                "display_score", expected="a score from 0 to 1", found=f"{self.display_score:g}"
            )

    @property
    def models(self) -> dict[DetectorModality, Path | None]:
        """ONNX file of each modality's detector, where one is named."""
        return {
            "rgb": self.rgb_model,
            "dm": self.dm_model,
            "rm": self.rm_model,
            "bev": self.bev_model,
        }


def _take_as_paths(config: DepthCnConfig | DetectionConfig, *names: str) -> None:
    for name in names:
        if (file := getattr(config, name)) is not None:
            object.__setattr__(config, name, Path(file))


NO_DETECTION = DetectionConfig(modalities=(), depthcn=DepthCnConfig(enabled=False))
