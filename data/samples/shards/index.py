"""The index of a folder of shards: which there are, and what a training has to know before it reads the first one."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from typing import Any, Self

from data.remote_folder import RemoteFolder
from data.samples.images.input_images import ImageConfig
from data.splits.training_frames import ENTRY, TrainingFrames
from perception.errors import UsageError

NAME = "index.json"
_FORMAT = "trifuse shards 1"
_ADVICE = "write it with: trifuse shards DRIVES --out FOLDER --modality dm"


@dataclass(frozen=True)
class Shard:
    """One tar file.

    Attributes:
        name: Name of the file.
        samples: Number of its samples.
        sha256: Hash of the file.
    """

    name: str
    samples: int
    sha256: str


@dataclass(frozen=True)
class ShardIndex:
    """Shards of one folder.

    Attributes:
        inputs: What the images of the samples are: their kind (rgb, or maps), size, filling, JPEG quality and fit.
        shards: Tar files.
        label_counts: Labels that are visible enough to be learned, by type.
        label_sizes_px: Some of their widths and heights in pixels of the input, by type.
        training_frames: Frames of the samples, as model files state them.
    """

    inputs: Mapping[str, Any]
    shards: tuple[Shard, ...]
    label_counts: Mapping[str, int]
    label_sizes_px: Mapping[str, Sequence[tuple[float, float]]]
    training_frames: str

    @property
    def samples(self) -> int:
        """Number of samples."""
        return sum(shard.samples for shard in self.shards)

    @property
    def frames(self) -> TrainingFrames | None:
        """Frames of the samples; None where they are not known."""
        return TrainingFrames.from_metadata({ENTRY: self.training_frames}, NAME)

    def require(self, config: ImageConfig, url: str) -> None:
        """Validate that the samples are the input that a network asks for.

        Raises:
            UsageError: They are of another modality, size or preparation.
        """
        asked = inputs_of(config)
        if asked != self.inputs:
            raise UsageError(
                url,
                expected=f"samples of the input of the network, {_text(asked)}",
                found=_text(self.inputs),
                advice="write shards of this input, or train with that of the shards",
            )

    def write(self, folder: RemoteFolder) -> None:
        """Write the index, which makes the shards those of the folder.

        Raises:
            DriveError: It cannot be written.
        """
        document = {"format": _FORMAT, **asdict(self)}
        folder.write(NAME, f"{json.dumps(document)}\n".encode())

    @classmethod
    def read(cls, folder: RemoteFolder) -> Self:
        """Read the index of a folder.

        Raises:
            DriveError: It cannot be read.
            UsageError: It is damaged, or another document.
        """
        try:
            document = json.loads(folder.read(NAME))
            if document.pop("format") != _FORMAT:
                raise ValueError("another format")
            shards = tuple(
                Shard(str(one["name"]), int(one["samples"]), str(one["sha256"]))
                for one in document.pop("shards")
            )
            counts = {str(k): int(n) for k, n in document.pop("label_counts").items()}
            if not shards or any("/" in one.name or one.samples < 1 for one in shards):
                raise ValueError("no shards")
            if set(document) != {one.name for one in fields(cls)} - {"shards", "label_counts"}:
                raise ValueError("other entries")
            return cls(shards=shards, label_counts=counts, **document)
        except (AttributeError, KeyError, TypeError, ValueError) as error:
            raise UsageError(
                f"{folder.url}/{NAME}",
                expected=f"an index of shards, {_FORMAT}",
                found=f"a damaged or another document ({error})",
                advice=_ADVICE,
            ) from error


def inputs_of(config: ImageConfig) -> dict[str, Any]:
    """Return what determines the images of samples, but for the classes; both maps are in one sample."""
    is_image = config.modality == "rgb"
    return {
        "kind": "rgb" if is_image else "maps",
        "size": str(config.size),
        "filling": None if is_image else config.filling,
        "jpeg_quality": config.jpeg_quality,
        "fit": config.fit,
    }


def _text(inputs: Mapping[str, Any]) -> str:
    return ", ".join(f"{name} {value}" for name, value in inputs.items() if value is not None)
