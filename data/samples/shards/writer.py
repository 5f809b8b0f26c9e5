"""Shards of labelled drives, written by all cores, each whole or not at all; the index last."""

import hashlib
import logging
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from data.batch.parts import run_parts
from data.frames import frame_name
from data.recorded_drive import RecordedDrive
from data.remote_folder import RemoteFolder
from data.samples.images.input_images import ImageConfig, make_images
from data.samples.images.targets import detection_targets, labels_within_image
from data.samples.shards.index import NAME, Shard, ShardIndex, inputs_of
from data.samples.shards.samples import members, pack
from data.splits.training_frames import TrainingFrames
from perception.detection.detectors.network_input import PixelRectangle
from perception.errors import LabelError, PerceptionError, UsageError
from perception.geometry.threads import usable_cores
from perception.types import Float64, OnBadFrame, Progress

log = logging.getLogger(__name__)
_MAX_SIZES = 10_000  # of labels of a type, in the index: anchors need no more


@dataclass(frozen=True)
class ShardSource:
    """Frames that become samples.

    Attributes:
        drives: Labelled drives.
        config: Input of the network.
        on_bad_frame: Stop at a damaged frame, or leave it out with a warning.
        samples: Samples of a shard.
        seed: Seed of the order.
    """

    drives: Sequence[RecordedDrive]
    config: ImageConfig
    on_bad_frame: OnBadFrame = "stop"
    samples: int = 256
    seed: int = 0

    def places(self) -> list[tuple[int, int]]:
        """Return (drive, frame) of all samples in random order, so that each shard is a fair sample of them."""
        places = [
            (number, index)
            for number, drive in enumerate(self.drives)
            for index in range(len(drive))
        ]
        order = np.random.default_rng(self.seed).permutation(len(places))
        return [places[row] for row in order.tolist()]


@dataclass(frozen=True)
class _Written:
    """One shard and its labels: (w, h) in pixels of the input, by type, of those that are visible enough."""

    shard: Shard
    sizes_px: dict[str, list[Float64]]


def write_shards(
    source: ShardSource,
    folder: RemoteFolder,
    *,
    workers: int | None = None,
    overwrite: bool = False,
    progress: Progress = iter,
) -> ShardIndex:
    """Write the samples of some drives as tar files, and return their index.

    Args:
        source: Drives, input, and what a shard holds.
        folder: Folder of the shards.
        workers: Processes that make the images; one per core by default.
        overwrite: Replace shards that are there.
        progress: Wrapper of the loop over frames that may show its progress.

    Raises:
        UsageError: There are shards already, or no frames.
        PerceptionError: A frame or the folder cannot be read or written.
    """
    if folder.has(NAME) and not overwrite:
        raise UsageError(
            folder.url,
            expected="a folder without shards",
            found=NAME,
            advice="choose another --out, or replace them with --overwrite",
        )
    places = source.places()
    parts = [
        (number, places[first : first + source.samples])
        for number, first in enumerate(range(0, len(places), source.samples))
    ]
    shown = iter(progress(range(len(places))))
    written = dict[int, _Written]()
    for (number, of_shard), one in run_parts(
        partial(_write, source, folder.url), parts, workers or usable_cores()
    ):
        written[number] = one
        for _ in of_shard:
            next(shown)
    next(shown, None)  # ends the bar
    made = [written[number] for number in sorted(written) if written[number].shard.samples]
    if not made:
        raise UsageError("shards", expected="at least one frame that can be read", found="none")
    index = _index(source, made, np.random.default_rng(source.seed))
    index.write(folder)
    return index


def _write(source: ShardSource, url: str, part: tuple[int, list[tuple[int, int]]]) -> _Written:
    """Write one shard."""
    number, places = part
    files, sizes_px, count = list[tuple[str, bytes]](), defaultdict[str, list[Float64]](list), 0
    for position, (drive_number, index) in enumerate(places):
        drive = source.drives[drive_number]
        try:
            arrays = make_images(drive[index], source.config)
            labels, _ = labels_within_image(drive.labels(index), tuple(arrays["size_px"].tolist()))
        except PerceptionError as error:
            if source.on_bad_frame == "stop":
                raise
            log.warning("left out frame %s: %s", frame_name(drive, index), error)
            continue
        files += members(f"{number:06d}-{position:06d}", arrays, labels)
        count += 1
        names = sorted(set(labels.types.astype(str).tolist()))
        placement = source.config.placement(PixelRectangle(*arrays["region"].tolist()))
        targets = detection_targets(labels, names, placement)
        seen = ~targets.is_ignored
        spans_px = targets.boxes_px[seen, 2:] - targets.boxes_px[seen, :2]
        for kind, span_px in zip(targets.classes[seen].tolist(), spans_px, strict=True):
            sizes_px[names[kind]].append(np.asarray(span_px, np.float64))
    data = pack(files)
    shard = Shard(f"shard-{number:06d}.tar", count, hashlib.sha256(data).hexdigest())
    if count:
        RemoteFolder(url).write(shard.name, data)
    return _Written(shard, dict(sizes_px))


def _index(source: ShardSource, made: Sequence[_Written], rng: np.random.Generator) -> ShardIndex:
    sizes_px = defaultdict[str, list[Float64]](list)
    for one in made:
        for name, spans_px in one.sizes_px.items():
            sizes_px[name] += spans_px
    if not sizes_px:
        raise LabelError(
            "labels of the drives",
            expected="at least one that is visible enough to be learned",
            found="none",
        )
    return ShardIndex(
        inputs=inputs_of(source.config),
        shards=tuple(one.shard for one in made),
        label_counts={name: len(spans) for name, spans in sorted(sizes_px.items())},
        label_sizes_px={name: _some(spans, rng) for name, spans in sorted(sizes_px.items())},
        training_frames=TrainingFrames.of(source.drives).text,
    )


def _some(spans_px: Sequence[Float64], rng: np.random.Generator) -> list[tuple[float, float]]:
    """Return sizes of labels; where there are too many, some of them at random."""
    rows = np.arange(len(spans_px))
    if len(rows) > _MAX_SIZES:
        rows = np.sort(rng.permutation(rows)[:_MAX_SIZES])
    return [(float(spans_px[row][0]), float(spans_px[row][1])) for row in rows.tolist()]
