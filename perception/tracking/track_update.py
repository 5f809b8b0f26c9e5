"""Update of box tracks by the clusters that continue them, and new tracks.

All positions are in the world.
"""

from dataclasses import dataclass, replace

import numpy as np

from perception.geometry.footprints import Footprints
from perception.localization.pose_covariance import plane_covariances_m2
from perception.tracking import motion_model
from perception.tracking.heading import UNKNOWN_VARIANCE, first_yaws, update_from_shape
from perception.tracking.size_estimate import MIN_COMPLETE_HITS, likely_sizes_m, update_sizes
from perception.tracking.track_table import TrackTable
from perception.tracking.vehicles.class_sizes import CLASS_SIZES, SizePriors
from perception.tracking.visible_sides import (
    Extents,
    from_world,
    measure_extents,
    place_centers,
    sensor_along,
    shift_behind,
    to_world,
)
from perception.types import BoxDeviations, Float64, Int

_LENGTH_M = 0.2  # standard deviation of a length of which both ends are seen
_HIDDEN_SHARE = 0.9  # of a class's deviations that observations leave of sizes not seen whole
_AXIS_RAD = 0.02  # standard deviation of the axis of an outline
_AXIS_SHARE = 0.6  # of the filter's deviation of the heading that is reported beside it
_REVERSAL = 0.01  # probability that the front is the rear

_CLASSES = np.array(["pedestrian", "cyclist", "car", "van", "truck", "tram"])
_LENGTHS_M = np.array([CLASS_SIZES[name].length.mean_m for name in _CLASSES.tolist()])
_HEIGHT_GAIN = 0.3  # of a correction of the height
_POSE_M = 0.2  # deviation of a place by the pose that the noise of a side holds
_MAX_SWING_RAD = 0.3  # maximum deviation of a heading that shifts the centre of a partly hidden box


def reported_covariances(tracks: TrackTable, sizes_m: Float64) -> Float64:
    """Return (T, 4, 4) covariances of x, y and the velocity in the world, of tracks with (T, 3) sizes."""
    reported = motion_model.reported_covariances(tracks)
    along = np.stack([np.cos(tracks.yaw_rad), np.sin(tracks.yaw_rad)], axis=1)
    end_m = _size_deviations(tracks, sizes_m)[:, 0] / 2
    reported[:, :2, :2] += end_m[:, None, None] ** 2 * along[:, :, None] * along[:, None]
    return reported


def reported_deviations(tracks: TrackTable, sizes_m: Float64) -> BoxDeviations:
    """Return the standard deviations of the boxes of tracks with (T, 3) sizes."""
    filtered_rad = _AXIS_SHARE * np.sqrt(tracks.yaw_variance)
    return BoxDeviations(
        _size_deviations(tracks, sizes_m),
        np.hypot(_AXIS_RAD, filtered_rad),
        np.full(len(tracks), _REVERSAL),
    )


def _size_deviations(tracks: TrackTable, sizes_m: Float64) -> Float64:
    """Return (T, 3) standard deviations of the sizes."""
    one = np.ones(len(tracks))
    nearest = np.abs(sizes_m[:, :1] - _LENGTHS_M).argmin(axis=1)
    priors = SizePriors.of(_CLASSES[nearest])
    deviations_m = priors.deviations_m(sizes_m, _HIDDEN_SHARE * one, one)
    has_both_ends = tracks.complete_counts[:, 0] >= MIN_COMPLETE_HITS
    deviations_m[has_both_ends, 0] = _LENGTH_M
    return deviations_m


@dataclass(frozen=True)
class SensorPose:
    """Pose of the LiDAR over the ground plane of the world.

    Attributes:
        place_m: (2,) its place.
        covariance: (6, 6) covariance of the pose, None where it is exact.
    """

    place_m: Float64
    covariance: Float64 | None = None

    def noise(self, places_m: Float64) -> Float64:
        """Return (P, 2, 2) what an uncommon error of the pose adds to the covariances of (P, 2) places."""
        if self.covariance is None:
            return np.zeros((len(places_m), 2, 2))
        away_m = places_m - self.place_m
        variances, axes = np.linalg.eigh(plane_covariances_m2(self.covariance, away_m))
        beyond = np.maximum(variances - _POSE_M**2, 0.0)
        return np.asarray(axes * beyond[:, None] @ axes.transpose(0, 2, 1))


@dataclass(frozen=True)
class BoxMeasurements:
    """Measurements of T tracks by F clusters.

    Attributes:
        centers_m: (T, F, 2) centres of the boxes.
        noise: (T, F, 2, 2) covariances of the centres.
        sizes_m: (T, F, 2) observed lengths and widths.
    """

    centers_m: Float64
    noise: Float64
    sizes_m: Float64


def measure_boxes(tracks: TrackTable, clusters: Footprints, sensor: SensorPose) -> BoxMeasurements:
    """Measure every track by every one of F clusters, at least one."""
    seen = measure_extents(clusters, tracks.yaw_rad, sensor.place_m)
    return _measure(tracks, seen, clusters.points[None], sensor.noise(clusters.centroids_m)[None])


def _measure(
    tracks: TrackTable, seen: Extents, points: Int, pose_noise: Float64
) -> BoxMeasurements:
    sizes_m = likely_sizes_m(tracks)
    centers = place_centers(seen, sizes_m)
    # A box turns around the observed side: its centre swings by the length of the hidden part.
    swing_rad = np.sqrt(np.minimum(tracks.yaw_variance, _MAX_SWING_RAD**2))
    hidden_m = np.maximum(sizes_m[:, None] - seen.sizes_m, 0.0)
    swing_m = hidden_m[..., ::-1] / 2 * swing_rad[:, None, None]
    return BoxMeasurements(
        to_world(centers.along_left_m, tracks.yaw_rad),
        pose_noise
        + motion_model.position_noise(
            seen.sizes_m, swing_m, centers.slack_m, points, tracks.yaw_rad[:, None]
        ),
        seen.sizes_m,
    )


def update_tracks(tracks: TrackTable, clusters: Footprints, sensor: SensorPose) -> TrackTable:
    """Correct each of T tracks by the cluster that continues it."""
    tracks = update_from_shape(tracks, clusters)
    seen = _own_extents(clusters, tracks.yaw_rad, sensor.place_m)
    tracks = _grown(tracks, seen)
    measured = _measure(
        tracks, seen, clusters.points[:, None], sensor.noise(clusters.centroids_m)[:, None]
    )
    tracks = motion_model.correct(tracks, measured.centers_m[:, 0], measured.noise[:, 0])
    heights_m = clusters.high_m - clusters.low_m
    return replace(
        tracks,
        heights_m=tracks.heights_m + _HEIGHT_GAIN * (heights_m - tracks.heights_m),
        low_world_m=tracks.low_world_m + _HEIGHT_GAIN * (clusters.low_m - tracks.low_world_m),
        points=tracks.points + clusters.points,
    )


def init_tracks(clusters: Footprints, sensor: SensorPose, stamp_s: float) -> TrackTable:
    """Return the new tracks of F clusters; their ids are 0 to F - 1."""
    count, yaw_rad = len(clusters), first_yaws(clusters, sensor.place_m)
    seen = _own_extents(clusters, yaw_rad, sensor.place_m)
    sizes_m, stamps_s = seen.sizes_m[:, 0], np.full(count, stamp_s)
    tracks = TrackTable(
        ids=np.arange(count),
        mean=np.zeros((count, 4)),
        covariance=np.zeros((count, 4, 4)),
        yaw_rad=yaw_rad,
        yaw_variance=np.full(count, UNKNOWN_VARIANCE),
        sizes_m=sizes_m,
        recent_sizes_m=np.repeat(sizes_m[:, None], 3, axis=1),
        complete_counts=np.zeros((count, 2), np.int64),
        heights_m=clusters.high_m - clusters.low_m,
        low_world_m=clusters.low_m,
        first_seen_s=stamps_s,
        first_seen_world_m=np.zeros((count, 2)),
        last_seen_s=stamps_s,
        last_moved_s=stamps_s,
        hits=np.ones(count, np.int64),
        observed_s=np.zeros(count),
        points=clusters.points,
        is_confirmed=np.zeros(count, bool),
    )
    measured = _measure(
        tracks, seen, clusters.points[:, None], sensor.noise(clusters.centroids_m)[:, None]
    )
    centers_m = measured.centers_m[:, 0]
    states = motion_model.init(centers_m, measured.noise[:, 0], sizes_m)
    return replace(
        tracks, mean=states.mean, covariance=states.covariance, first_seen_world_m=centers_m
    )


def _own_extents(clusters: Footprints, yaw_rad: Float64, sensor_m: Float64) -> Extents:
    """Return the extents of each of F outlines along its own heading, as F tracks of one outline each."""
    low_m, high_m = clusters.extents_m(yaw_rad)
    return Extents(low_m[:, None], high_m[:, None], sensor_along(sensor_m, yaw_rad))


def _grown(tracks: TrackTable, seen: Extents) -> TrackTable:
    """Update the sizes; a box grows behind the side that faces the sensor."""
    before_m = likely_sizes_m(tracks)
    is_complete = seen.is_complete[:, 0]
    sizes_m, recent_m, complete = update_sizes(tracks, seen.sizes_m[:, 0], is_complete)
    grown = replace(tracks, sizes_m=sizes_m, recent_sizes_m=recent_m, complete_counts=complete)
    away_m = from_world(tracks.mean[:, :2], tracks.yaw_rad) - seen.sensor_m
    shift_m = shift_behind(away_m, before_m, likely_sizes_m(grown), tracks.yaw_rad)
    return replace(grown, mean=tracks.mean + np.pad(shift_m, ((0, 0), (0, 2))))
