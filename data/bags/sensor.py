"""The LiDAR of a bag, which states neither its model nor its height: both are estimated from some scans."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from data.bags.sweeps import BagLidar, points_velo
from data.beam_pattern import BeamPattern
from data.clouds.cloud import Cloud
from data.clouds.lidar_estimate import LidarEstimate, estimate_lidar
from data.clouds.mounting_estimate import fit_ground
from data.layouts import OpenConfig
from data.reflectance import sample_indices
from perception.sensor import HDL_64E, SENSORS, LidarModel
from perception.types import Bool, Float32


@dataclass(frozen=True)
class BagSensor:
    """LiDAR model of a drive.

    Attributes:
        model: LiDAR model.
        notes: Sentences on what was estimated or assumed.
    """

    model: LidarModel
    notes: tuple[str, ...]


def find_sensor(
    path: Path, lidar: BagLidar, config: OpenConfig, rate_hz: float | None, height_m: float | None
) -> BagSensor:
    """Return the model that was asked for, or that of a sensor.json beside the bag, else estimate it.

    Args:
        path: Bag.
        lidar: LiDAR of the drive.
        config: How the bag is read.
        rate_hz: Scans per second, or None where there is one.
        height_m: Height above the road in metres by the transforms of the bag, or None.

    Raises:
        UsageError: There is no such model.
        DriveError: The bag is damaged.
    """
    folder = path if path.is_dir() else path.parent
    is_known = config.sensor is not None and config.sensor.casefold() in map(str.casefold, SENSORS)
    if (config.sensor is not None and not is_known) or (
        config.sensor is None and (folder / "sensor.json").is_file()
    ):
        return BagSensor(config.lidar_model(folder), ())  # a file states height and rate, too
    clouds = [lidar.cloud(index) for index in sample_indices(len(lidar.stream))]
    notes = []
    if config.sensor is not None:
        model = config.lidar_model(folder)
    else:
        model, found = _estimated(clouds)
        notes.append(f"{path}: {found}; name another with --sensor")
    if height_m is None:
        height_m = _height_m([points_velo(cloud, lidar) for cloud in clouds])
        if height_m is None:
            notes.append(
                f"{path}: no ground was found; the LiDAR is taken {model.height_m} m above it"
            )
    height_m, rate_hz = height_m or model.height_m, rate_hz or model.rate_hz
    return BagSensor(replace(model, height_m=height_m, rate_hz=rate_hz), tuple(notes))


def _estimated(clouds: Sequence[Cloud]) -> tuple[LidarModel, str]:
    """Return the model by the beams of some scans, and what was found in a few words."""
    scans = [cloud.xyz[_is_return(cloud)] for cloud in clouds]
    rings = [None if cloud.ring is None else cloud.ring[_is_return(cloud)] for cloud in clouds]
    estimate = estimate_lidar(scans, rings)
    if estimate is None:
        return HDL_64E, f"too few returns to tell the LiDAR; it is taken as {HDL_64E.name}"
    if estimate.model is not None:
        return estimate.model, f"the beams are those of {estimate.model.name}"
    similar = None if estimate.has_rings else _similar(scans)
    if similar is not None:
        return similar, f"the beams are like those of {similar.name}"
    model = _own_model(estimate)
    low, high = np.degrees(model.elevations_rad[[-1, 0]])
    return (
        model,
        f"the LiDAR is of no known model: {model.beams} beams from {low:.1f} to {high:.1f} degrees",
    )


def _similar(scans: Sequence[Float32]) -> LidarModel | None:
    """Return the known model whose range and spacing of beams all scans have; calibrated beams are off the data sheet's."""
    patterns = [BeamPattern.of(scan) for scan in scans]
    names = [set() if one is None else set(one.fitting_sensors()) for one in patterns]
    first = patterns[0].fitting_sensors() if patterns[0] is not None else []
    common = set.intersection(*names)
    return next((SENSORS[name] for name in first if name in common), None)


def _own_model(estimate: LidarEstimate) -> LidarModel:
    step_rad = estimate.azimuth_step_rad or HDL_64E.azimuth_step_rad
    return replace(
        HDL_64E,
        name=f"LiDAR of {len(estimate.elevations_rad)} beams",
        elevations_rad=estimate.elevations_rad,
        azimuth_step_rad=step_rad,
    )


def _height_m(scans: Sequence[Float32]) -> float | None:
    """Return the median height above the ground in metres, or None where no scan shows ground."""
    planes = [fit_ground(scan[scan[:, :3].any(axis=1), :3]) for scan in scans]
    heights_m = [plane.height_m for plane in planes if plane is not None]
    return float(np.median(heights_m)) if heights_m else None


def _is_return(cloud: Cloud) -> Bool:
    return np.asarray(np.isfinite(cloud.xyz).all(axis=1) & cloud.xyz.any(axis=1))
