"""A synthetic drive whose scans are cast once and used with one INS after another."""

from copy import copy
from typing import Self

from data.synthetic.drive import SyntheticDrive
from data.synthetic.ins import InsNoise
from data.synthetic.lidar import LidarScan
from perception.sensor import HDL_64E, LidarModel


class CachedDrive(SyntheticDrive):
    """A `SyntheticDrive` without images that keeps its scans: 4 MB each of an HDL-64E."""

    def __init__(
        self,
        frames: int = 80,
        *,
        seed: int = 0,
        sensor: LidarModel = HDL_64E,
        noise: InsNoise | None = None,
    ) -> None:
        """Draw the world.

        Args:
            frames: Number of scans.
            seed: Seed of the world and of all noise.
            sensor: LiDAR model.
            noise: Noise of the INS; else that of KITTI's INS.
        """
        super().__init__(frames, seed=seed, sensor=sensor, noise=noise, images=False)
        self._scans: dict[int, LidarScan] = {}

    def scan(self, index: int) -> LidarScan:
        """Return the scan of one frame, casting its rays at the first call only."""
        index = range(len(self))[index]
        if index not in self._scans:
            self._scans[index] = super().scan(index)
        return self._scans[index]

    def with_ins(self, noise: InsNoise) -> Self:
        """Return the same drive with another INS; world and scans, which do not depend on it, are shared."""
        other = copy(self)
        other._noise = noise
        for drawn in ("_packets", "_metres"):
            other.__dict__.pop(drawn, None)
        return other
