"""Scans as maps from above and their targets: a torch `Dataset` that augments each whenever it is indexed."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import torch
from torch import Tensor
from torch.nn.utils.rnn import pad_sequence
from torch.utils.data import Dataset

from data.samples.bev.config import BevAugmentationConfig
from data.samples.bev.labelled_scans import BevObjects, LabelledScan, LabelledScans
from data.samples.bev.pasting import owners_of_returns, pastable_rows, paste
from data.samples.epoch_samplers import SampleIndex
from perception.detection.bev.bev_map import BLOCK, REFLECTANCE, SIDE_STEP, BevGrid, BevMapper
from perception.detection.bev.classes import BEV_CLASSES, SYNTHETIC_CLASSES, class_numbers
from perception.errors import UsageError
from perception.geometry.se3 import wrap
from perception.obstacles.range_image import SphericalProjection
from perception.sensor import LidarModel
from perception.types import Bool, Float32, Float64, Int, UInt8

MIN_RETURNS = 2  # of an object to be learned from and to be found
_THINNED_FROM = 32  # beams
_STRETCHED = "Car"
Sample = Mapping[str, Tensor]


@dataclass(frozen=True)
class BevConfig:
    """Input and classes of the network.

    Attributes:
        grid: Cells of the map.
        class_names: Classes to detect.
    """

    grid: BevGrid = field(default_factory=BevGrid)
    class_names: tuple[str, ...] = SYNTHETIC_CLASSES

    def __post_init__(self) -> None:
        """Validate the classes."""
        unknown = [name for name in self.class_names if name not in BEV_CLASSES]
        if unknown or not self.class_names:
            raise UsageError(
                "classes of the bird's-eye view",
                expected=f"some of {', '.join(BEV_CLASSES)}",
                found=", ".join(unknown) or "none",
            )


class BevDataset(Dataset[Sample]):
    """Maps and targets of some scans, by row (unchanged) or by `SampleIndex` (augmented).

    A sample holds

        maps        (R / 4, R / 4, 16, C) uint8, cells in blocks of 4x4
        boxes       (L, 7)    float32, x, y and height of the bottom, length, width, height, heading
        classes     (L,)      int64, indices into the class names; 0 of others
        is_ignored  (L,)      bool, objects of other classes or with few returns: a detection is neither right nor wrong
        view_rad    (2,)      float32, middle and half width of the directions in which everything is labelled
        middle_m    (2,)      float32, middle of the map, from which a crop was cut
        numbers     ()        int64, row of the sample
    """

    def __init__(
        self,
        scans: LabelledScans,
        numbers: Int,
        config: BevConfig,
        augmentation: BevAugmentationConfig | None = None,
        seed: int = 0,
    ) -> None:
        """Take the scans.

        Args:
            scans: Labelled scans.
            numbers: (F,) numbers of the scans that are samples.
            config: Input and classes of the network.
            augmentation: Magnitudes of the augmentation; None leaves samples unchanged.
            seed: Seed of the augmentation.
        """
        self.scans, self.numbers = scans, np.asarray(numbers, np.int64)
        self.config, self.augmentation, self.seed = config, augmentation, seed
        self._mappers: dict[tuple[int, int], BevMapper] = {}

    def __len__(self) -> int:
        return len(self.numbers)

    def __getitem__(self, index: SampleIndex | int) -> Sample:
        """Return one sample.

        Raises:
            PerceptionError: its frame has to be read again and cannot be.
        """
        row = index.row if isinstance(index, SampleIndex) else index
        number = int(self.numbers[row])
        scan, sensor = self.scans.scan(number), self.scans.sensor(number)
        if self.augmentation is None or not isinstance(index, SampleIndex):
            maps = self._mapper(sensor, 1).make(scan.points_velo, scan.heights_m)
            return self._sample(row, maps, scan.labels, np.zeros(2, np.int64))
        magnitudes, rng = self.augmentation, np.random.default_rng([self.seed, *index.view])
        step = 1 + (sensor.beams >= _THINNED_FROM and rng.random() < magnitudes.thinning)
        if magnitudes.paste:
            scan = self._pasted(scan, number, rng)
        scan = stretch(_every(scan, sensor, step), magnitudes, rng)
        scan = augment(scan, magnitudes, rng)
        scan = jitter(scan, magnitudes, rng)
        maps = self._mapper(sensor, step).make(scan.points_velo, scan.heights_m)
        if rng.random() < magnitudes.reflectance:
            maps[..., REFLECTANCE] = 0
        center_m = self._draw_center_m(scan.labels, rng)
        cropped, first = crop(maps, center_m, self.config.grid, magnitudes.crop, rng)
        middle = first + len(cropped) // 2 - len(maps) // 2
        return self._sample(row, cropped, scan.labels, middle)

    def _pasted(self, scan: LabelledScan, number: int, rng: np.random.Generator) -> LabelledScan:
        """Return a scan with objects of another of the same drive, of rare classes more often."""
        assert self.augmentation is not None
        drive, _ = self.scans.place(number)
        numbers = [one for one in self.numbers.tolist() if self.scans.place(one)[0] is drive]
        donor = self.scans.scan(int(rng.choice(numbers)))
        known = np.array(class_numbers(donor.labels.types.tolist(), self.config.class_names))
        rows = pastable_rows(donor.labels)
        rows = rows[known[rows] >= 0]
        count = min(int(rng.integers(self.augmentation.paste + 1)), len(rows))
        if not count:
            return scan
        weights = self._rarities[known[rows]]
        drawn = rng.choice(rows, count, replace=False, p=weights / weights.sum())
        projection = SphericalProjection(drive.sensor, tolerance_m=0.1)
        return paste(scan, donor, drawn, projection, rng)

    def _draw_center_m(self, labels: BevObjects, rng: np.random.Generator) -> Float32:
        """Return where one of the targets is, of a rare class more often; the sensor's place without one."""
        targets = self._targets(labels)
        rows = np.flatnonzero(~targets["is_ignored"].numpy())
        if not len(rows):
            return np.zeros(2, np.float32)
        weights = self._rarities[targets["classes"].numpy()[rows]]
        row = rng.choice(rows, p=weights / weights.sum())
        return targets["boxes"][row, :2].numpy()

    @cached_property
    def _rarities(self) -> Float64:
        """(K,) inverse root of the number of targets of each class."""
        counts = self.target_types()
        return np.array([max(counts[name], 1) ** -0.5 for name in self.config.class_names])

    def _sample(self, row: int, maps: UInt8, labels: BevObjects, middle: Int) -> Sample:
        middle_m = torch.from_numpy(middle * BLOCK * self.config.grid.cell_m).float()
        return {
            "maps": torch.from_numpy(maps),
            **self._targets(labels),
            "middle_m": middle_m,
            "numbers": torch.tensor(row),
        }

    def targets(self, row: int) -> Sample:
        """Return the targets of an unchanged sample."""
        return self._targets(self.scans.labels(int(self.numbers[row])))

    def target_types(self) -> Counter[str]:
        """Return the number of targets of each class."""
        names = self.config.class_names
        return Counter(
            names[number]
            for one in self._all_targets
            for number in one["classes"][~one["is_ignored"]].tolist()
        )

    @cached_property
    def _all_targets(self) -> list[Sample]:
        return [self.targets(row) for row in range(len(self))]

    def _targets(self, labels: BevObjects) -> Sample:
        numbers = np.array(class_numbers(labels.types.tolist(), self.config.class_names), np.int64)
        reach_m = self.config.grid.reach_m
        is_inside = np.asarray((np.abs(labels.boxes[:, :2]) < reach_m).all(axis=1))
        is_ignored = (numbers < 0) | (labels.returns < MIN_RETURNS)
        return {
            "boxes": torch.from_numpy(np.array(labels.boxes[is_inside], np.float32)),
            "classes": torch.from_numpy(np.maximum(numbers, 0)[is_inside]),
            "is_ignored": torch.from_numpy(is_ignored[is_inside]),
            "view_rad": torch.from_numpy(np.array(labels.view_rad, np.float32)),
        }

    def _mapper(self, sensor: LidarModel, step: int) -> BevMapper:
        key = id(sensor), step
        if key not in self._mappers:
            thinned = replace(sensor, elevations_rad=sensor.elevations_rad[::step])
            self._mappers[key] = BevMapper(thinned, self.config.grid)
        return self._mappers[key]


def augment(
    scan: LabelledScan, magnitudes: BevAugmentationConfig, rng: np.random.Generator
) -> LabelledScan:
    """Return a scan that is turned, mirrored and scaled about its sensor, with its labels."""
    turn = rng.uniform(-magnitudes.turn_rad, magnitudes.turn_rad)
    scale = 1 + rng.uniform(-magnitudes.scale, magnitudes.scale)
    side = -1.0 if rng.random() < magnitudes.mirror else 1.0
    # Mirrored first, then turned.
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    matrix = (scale * rotation @ np.diag([1.0, side])).astype(np.float32)
    points = np.array(scan.points_velo)
    points[:, :2] = points[:, :2] @ matrix.T
    points[:, 2] *= scale
    labels = scan.labels
    boxes = np.array(labels.boxes)
    boxes[:, :2] = boxes[:, :2] @ matrix.T
    boxes[:, 2:6] *= scale
    boxes[:, 6] = wrap((side * boxes[:, 6] + turn).astype(np.float64))
    view = np.array([wrap(side * labels.view_rad[0] + turn), labels.view_rad[1]], np.float32)
    heights_m = np.asarray(scale * scan.heights_m, np.float32)
    return LabelledScan(points, heights_m, replace(labels, boxes=boxes, view_rad=view))


def stretch(
    scan: LabelledScan, magnitudes: BevAugmentationConfig, rng: np.random.Generator
) -> LabelledScan:
    """Return a scan whose cars are longer and wider, each about its middle, with the returns on them."""
    rows = np.flatnonzero(scan.labels.types == _STRETCHED)
    boxes, points = np.array(scan.labels.boxes), np.array(scan.points_velo)
    cars = boxes[rows].astype(np.float64)
    owners = owners_of_returns(scan, cars)
    inside = np.flatnonzero(owners >= 0)
    cars = cars[owners[inside]]
    factors = 1 + rng.uniform(0, magnitudes.stretch * np.array([1.0, 0.5]), (len(rows), 2))
    ahead = np.column_stack([np.cos(cars[:, 6]), np.sin(cars[:, 6])])
    for number, axis in enumerate((ahead, ahead[:, ::-1] * (-1.0, 1.0))):
        along_m = ((points[inside, :2] - cars[:, :2]) * axis).sum(axis=1)
        grown = factors[owners[inside], number] - 1
        points[inside, :2] += (grown * along_m)[:, None] * axis
    boxes[rows, 3:5] *= factors
    return LabelledScan(points, scan.heights_m, replace(scan.labels, boxes=boxes))


def jitter(
    scan: LabelledScan, magnitudes: BevAugmentationConfig, rng: np.random.Generator
) -> LabelledScan:
    """Return a scan as another sensor or ground would give it: fewer returns, brighter, and the ground off a little."""
    scan = _kept(scan, rng.random(len(scan.points_velo)) >= rng.uniform(0, magnitudes.dropout))
    points = np.array(scan.points_velo)
    points[:, 3] = np.minimum(points[:, 3] * np.exp(rng.normal(0, magnitudes.gain)), 1)
    offset_m = np.float32(rng.normal(0, magnitudes.ground_m))
    slope = rng.normal(0, magnitudes.tilt_rad, 2).astype(np.float32)
    boxes = np.array(scan.labels.boxes)
    boxes[:, 2] += boxes[:, :2] @ slope + offset_m
    heights_m = scan.heights_m + points[:, :2] @ slope + offset_m
    return LabelledScan(points, heights_m, replace(scan.labels, boxes=boxes))


def crop(
    maps: UInt8, center_m: Float32, grid: BevGrid, share: float, rng: np.random.Generator
) -> tuple[UInt8, Int]:
    """Return a part of a map that holds a place, and the row and column of its first block.

    Args:
        maps: (R / 4, R / 4, 16, C) map.
        center_m: (2,) place within the map.
        grid: Cells of the map.
        share: Fraction of each side that is left out.
        rng: Random generator.
    """
    side, step = len(maps), SIDE_STEP // BLOCK
    kept = max(round((1 - share) * side / step), 1) * step
    center = (center_m + grid.reach_m) / (BLOCK * grid.cell_m) + rng.uniform(-0.4, 0.4, 2) * kept
    first = np.clip(center.astype(np.int64) - kept // 2, 0, side - kept)
    row, column = first.tolist()
    return np.ascontiguousarray(maps[row : row + kept, column : column + kept]), first


def _every(scan: LabelledScan, sensor: LidarModel, step: int) -> LabelledScan:
    """Return a scan of every so-many-th beam."""
    if step == 1:
        return scan
    rows = SphericalProjection(sensor, tolerance_m=0.1).pixels(scan.points_velo).rows
    return _kept(scan, rows % step == 0)


def _kept(scan: LabelledScan, is_kept: Bool) -> LabelledScan:
    """Return a scan of some of its returns; of each object the same share of them is left."""
    returns = (scan.labels.returns * is_kept.mean()).astype(np.int64)
    labels = replace(scan.labels, returns=returns)
    return LabelledScan(scan.points_velo[is_kept], scan.heights_m[is_kept], labels)


def collate(samples: Sequence[Sample]) -> Sample:
    """Return a batch; targets are padded with boxes of zero size."""
    stacked = {
        name: torch.stack([one[name] for one in samples])
        for name in ("maps", "view_rad", "middle_m", "numbers")
    }
    padded = {
        name: pad_sequence([one[name] for one in samples], batch_first=True)
        for name in ("boxes", "classes", "is_ignored")
    }
    return {**stacked, **padded}
