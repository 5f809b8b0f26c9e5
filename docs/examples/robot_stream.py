"""Live use on a robot: frames come when they come, and the latest counts.

python docs/examples/robot_stream.py DRIVE plays a drive in the place of the robot's LiDAR.
"""

import sys
from collections.abc import Iterable

import numpy as np

from data.live.source import PacedDrive
from data.open_drive import open_drive
from perception.pipeline import Pipeline, PipelineConfig
from perception.sensor import LidarModel
from perception.types import Frame, Result


def free_ahead_m(result: Result, half_width_m: float = 1.2) -> float:
    """Return the distance to the nearest obstacle in the vehicle's lane, or infinity."""
    voxels = result.obstacles.static.centers_m, result.obstacles.moving.centers_m
    x, y, _ = np.concatenate(voxels).T
    return float(x[(x > 0) & (np.abs(y) < half_width_m)].min(initial=np.inf))


def drive_by(frames: Iterable[Frame], sensor: LidarModel) -> None:
    """Print what the robot must know of each frame; frames that come meanwhile are dropped."""
    config = PipelineConfig.for_motion()
    with Pipeline(sensor, config) as pipeline, pipeline.stream(frames, "latest") as results:
        for result in results:
            speeds_m_s = np.linalg.norm(result.tracks.velocities_m_s, axis=1).round(1)
            print(f"{result.frame.stamp_s:.1f} s: {free_ahead_m(result):.1f} m free,", end=" ")
            print(f"moving at {speeds_m_s} m/s, {results.dropped} frames dropped", flush=True)


if __name__ == "__main__":
    drive = open_drive(sys.argv[1])
    drive_by(next(PacedDrive(drive).laps()), drive.sensor)
