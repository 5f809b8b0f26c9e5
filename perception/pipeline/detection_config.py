"""Which detectors look at a frame, and from which files."""

from dataclasses import dataclass
from pathlib import Path

from perception.errors import UsageError
from perception.types import MODALITIES, Modality


@dataclass(frozen=True)
class DetectionConfig:
    """Which detectors look at the frames that have a camera.

    Attributes:
        modalities: whose detectors are fused: rgb, dm, rm; None for all whose network comes with this copy
            or is named here, an empty list for none.
        depthcn: whether DepthCN looks, too.
        rgb_model: file of another network than the one that ships, as are all of these.
        dm_model: of the depth map's detector.
        rm_model: of the reflectance map's detector.
        fusion_model: of the network that weighs the three.
        depthcn_model: of DepthCN.
    """

    modalities: tuple[Modality, ...] | None = None
    depthcn: bool = True
    rgb_model: Path | None = None
    dm_model: Path | None = None
    rm_model: Path | None = None
    fusion_model: Path | None = None
    depthcn_model: Path | None = None

    def __post_init__(self) -> None:
        """Refuse a modality twice."""
        if self.modalities is not None and len(set(self.modalities)) < len(self.modalities):
            raise UsageError(
                "modalities",
                expected=f"some of {', '.join(MODALITIES)}, each once",
                found=", ".join(self.modalities),
            )

    @property
    def files(self) -> dict[Modality, Path | None]:
        """By modality, the file that was named for its detector."""
        return {"rgb": self.rgb_model, "dm": self.dm_model, "rm": self.rm_model}


NO_DETECTION = DetectionConfig(modalities=(), depthcn=False)
