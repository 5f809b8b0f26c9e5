"""Tracker of detected vehicles, in the images and on the ground.

A detection continues the track whose predicted box it overlaps in the image and whose predicted position it is near on
the ground. Both complement each other: the image distinguishes far vehicles of few returns, the ground those that
occlude each other. Where another camera detects the object, its track continues by the outline of its 3D box there.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from perception.geometry.box_overlap_px import paired_iou_px
from perception.geometry.camera import box_outlines_px
from perception.maps.projection import camera_of
from perception.tracking import motion_model
from perception.tracking.association import assign_sure_first
from perception.tracking.track_table import MAX_PAUSE_S, ROUNDING_S
from perception.tracking.track_update import SensorPose
from perception.tracking.tracker import covariances_velo
from perception.tracking.vehicles.box_uncertainty import box_deviations, tracked_covariances
from perception.tracking.vehicles.class_names import (
    NAMED_CLASSES,
    class_likelihoods,
    log_shares,
    names_in_images,
)
from perception.tracking.vehicles.class_sizes import SizePriors
from perception.tracking.vehicles.config import VehicleTrackerConfig
from perception.tracking.vehicles.duplicates import is_duplicate, merged
from perception.tracking.vehicles.evidence import (
    MISS,
    added,
    probability,
    remembered,
)
from perception.tracking.vehicles.fronts import FrontRecord, shape_odds, with_fronts
from perception.tracking.vehicles.observations import (
    ASSUMED_HEIGHT_M,
    FrameGeometry,
    VehicleObservations,
)
from perception.tracking.vehicles.shared_ids import SharedIds
from perception.tracking.vehicles.surround_views import (
    surround_views,
    with_views,
    without_views,
)
from perception.tracking.vehicles.track_update import (
    RELOCATE_AFTER_S,
    SMALL_LENGTH_M,
    expected_boxes_px,
    init_tracks,
    is_velocity_known,
    position_distances,
    update_tracks,
)
from perception.tracking.vehicles.vehicle_table import VehicleTable, hidden_sides
from perception.types import (
    BoxDeviations,
    Boxes3D,
    Float64,
    Frame,
    FusedDetections,
    Int,
    Tracks,
    Vehicles,
)

_HIGH_EXISTENCE = 0.5  # minimum existence of a detection that is assigned before the others
_MIN_IOU = 0.1  # minimum IoU in the image of a detection and the track that it continues, or else:
_IMAGE_GATE = (
    13.3  # maximum squared distance of the sides (99 %, chi-squared, 4 degrees of freedom)
)
_SIDE_DEVIATION_SHARE = 0.16  # of the sides of a 2D box from their prediction, in width and height
_MIN_SIZE_PX = 4.0  # minimum width and height in that share
# Maximum squared distance of a detection, four sides and a position, in standard deviations: all
# but 1 of 20,000 true pairs (chi-squared, 6 degrees of freedom).
_MAX_COST = 30.0
_MAX_GROUND_COST = 20.0  # the same of the position of what was found from above
_OUTLINE_WEIGHT = 0.6  # of the outline of a 3D box in the reported box of a vehicle in the image
_MAX_OUTLINE_SHARE = 0.4  # maximum difference of their sides, in width and height, where they agree
_MAX_UNLOCATED_S = 2.0  # after which a track has the place and the class of its image alone
_WALKER, _RIDER = "Pedestrian", "Cyclist"
_OUTWARD = np.array([-1.0, -1.0, 1.0, 1.0])  # signs of growth at the sides x1 y1 x2 y2


@dataclass(frozen=True)
class VehicleTrackerResult:
    """Vehicles and moving objects of one scan, with common ids.

    Attributes:
        vehicles: Vehicles with ids and velocities; the id of an unconfirmed one is -1.
        tracks: Tracks of moving objects; one that is also a vehicle has its id.
    """

    vehicles: Vehicles
    tracks: Tracks


class VehicleTracker:
    """Tracks detected vehicles, and gives common ids to them and to moving objects."""

    def __init__(self, config: VehicleTrackerConfig | None = None) -> None:
        self._config = config or VehicleTrackerConfig()
        self._shared_ids, self._fronts = SharedIds(), FrontRecord()
        self.clear()

    def clear(self) -> None:
        """Delete all tracks; their ids are not used again."""
        self._classes, self._named = NAMED_CLASSES, set[str]()
        self._tracks = replace(
            VehicleTable.empty(), class_evidence=np.zeros((0, len(NAMED_CLASSES)))
        )
        self._seen: Int = np.zeros(0, np.int64)
        self._track_of: Int = np.zeros(0, np.int64)
        self._stamp_s: float | None = None
        self._elapsed_s = 0.0
        self._shared_ids.clear()

    def update(
        self,
        vehicles: Vehicles,
        frame: Frame,
        world_SE3_velo: Float64,
        tracks: Tracks | None = None,
        covariance: Float64 | None = None,
    ) -> VehicleTrackerResult:
        """Update the tracks by the detections of one frame.

        Args:
            vehicles: Located detections of the frame, each object once, without ids.
            frame: Time and cameras; a frame that is not later than the last one clears the tracks.
            world_SE3_velo: (4, 4) pose of the frame.
            tracks: Moving objects in the same scan, with the ids of their own tracker; None without one.
            covariance: (6, 6) covariance of the pose; vehicles are located as much worse. None where it is exact.
        """
        if self._stamp_s is not None and frame.stamp_s <= self._stamp_s:
            self.clear()
        cameras = [
            FrameGeometry(frame.stamp_s, world_SE3_velo, calibration.image_P_velo, size_px)
            for calibration, size_px in map(camera_of, frame.views)
        ]
        real = len(cameras)
        if (vehicles.cameras < 0).any() or (self._tracks.cameras >= real).any():
            views = surround_views(frame.stamp_s, world_SE3_velo)
            cameras, vehicles = [*cameras, *views], with_views(vehicles, views, real)
        self._sensor = SensorPose(world_SE3_velo[:2, 3], covariance)
        by_shape = shape_odds(vehicles, frame.points_velo)
        expected_rad = vehicles.boxes.yaw_rad
        vehicles = with_fronts(vehicles, self._fronts.odds(vehicles, by_shape))
        self._predict(cameras[0])
        self._learn_classes(np.append(vehicles.fused.detections.types, vehicles.bev_types))
        observations = VehicleObservations.of(
            vehicles, cameras, self._classes, self._config.min_existence
        )
        doubt = self._sensor.noise(observations.boxes_world.bottom_m[:, :2])
        observations = replace(observations, noise=observations.noise + doubt)
        self._update_and_init(observations, cameras)
        self._tracks, row_of = merged(self._tracks, frame.stamp_s, cameras)
        self._track_of = row_of[self._track_of]
        self._learn_fronts(expected_rad, by_shape, world_SE3_velo)
        types = self._types(self._tracks)
        tracks = self._give_ids(cameras[0], types, tracks or Tracks.empty())
        tracked = self._with_tracks(self._with_classes(vehicles), cameras, types)
        return VehicleTrackerResult(without_views(tracked, real), tracks)

    def _predict(self, frame_geometry: FrameGeometry) -> None:
        """Predict the tracks, and delete those that the frame before has missed for too long; after a long pause all."""
        elapsed_s = 0.0 if self._stamp_s is None else frame_geometry.stamp_s - self._stamp_s
        self._stamp_s, self._elapsed_s = frame_geometry.stamp_s, elapsed_s
        tracks, config = self._tracks, self._config
        limit_s = np.where(tracks.ids >= 0, config.max_unseen_s, config.max_unseen_unconfirmed_s)
        before_s = frame_geometry.stamp_s - elapsed_s
        goes_on = before_s - tracks.last_seen_s <= limit_s + ROUNDING_S
        goes_on &= (tracks.ids >= 0) | (tracks.evidence > 0)
        goes_on &= elapsed_s <= MAX_PAUSE_S
        tracks = tracks[goes_on]
        tracks = tracks.moved(tracks.modes.predicted(elapsed_s))
        unlocated_s = frame_geometry.stamp_s - tracks.last_located_s
        self._tracks = replace(
            tracks,
            evidence=remembered(elapsed_s) * tracks.evidence,
            is_located=tracks.is_located & (unlocated_s <= _MAX_UNLOCATED_S + ROUNDING_S),
        )

    def _learn_classes(self, types: NDArray[np.str_]) -> None:
        """Note the classes that some source names; one of other detectors was as unlikely as the unlikeliest so far."""
        self._named |= set(types.tolist()) - {""}
        new = sorted(self._named - set(self._classes.tolist()))
        self._classes = np.array([*self._classes.tolist(), *new], np.str_)
        known = self._tracks.class_evidence
        lowest = np.tile(known.min(axis=1, keepdims=True), len(new))
        self._tracks = replace(self._tracks, class_evidence=np.hstack([known, lowest]))

    def _learn_fronts(
        self, expected_rad: Float64, by_shape: Float64, world_SE3_velo: Float64
    ) -> None:
        """Note which vehicles head as expected, by their shapes and the ways that their tracks went."""
        tracks = self._tracks[self._track_of]
        yaw_rad = tracks.boxes_velo(tracks.sizes_m, world_SE3_velo).yaw_rad
        is_ahead = np.cos(yaw_rad - expected_rad[self._seen]) > 0
        odds = by_shape[self._seen] + tracks.travelled * np.where(is_ahead, 1, -1)
        is_vehicle = tracks.is_located & (tracks.sizes_m[:, 0] >= SMALL_LENGTH_M)
        rows = is_vehicle & np.isfinite(expected_rad[self._seen])
        self._fronts.update(odds[rows], tracks.detections[rows] == 1, self._elapsed_s)

    def _update_and_init(
        self, observations: VehicleObservations, cameras: Sequence[FrameGeometry]
    ) -> None:
        """Continue tracks by detections, those that surely exist first, and begin new tracks by the others."""
        observations = observations[~is_duplicate(observations)]
        existence, track_of = observations.existence, np.full(len(observations), -1)
        expected_px = self._expected_boxes_px(cameras)
        deviations_px, pose_shares = self._side_deviations_px(expected_px)
        # Each track as the camera of each detection would show it.
        numbers = observations.cameras
        costs = self._costs(
            observations, *(np.moveaxis(one[numbers], 0, 1) for one in (expected_px, deviations_px))
        )
        pairs = assign_sure_first(
            costs, np.isfinite(costs), _MAX_COST, existence >= _HIGH_EXISTENCE
        )
        track_of[pairs.detections] = pairs.tracks
        missed = np.zeros(len(self._tracks))
        missed[pairs.unmatched_tracks] = added(MISS, self._elapsed_s)
        self._tracks = replace(self._tracks, evidence=self._tracks.evidence + missed)
        is_new = (track_of < 0) & (existence >= self._config.new_track_existence)
        seen, new = np.flatnonzero(track_of >= 0), np.flatnonzero(is_new)
        rows = track_of[seen]
        if len(rows):
            corrected = update_tracks(
                self._tracks[rows],
                observations[seen],
                expected_px[numbers[seen], rows],
                pose_shares[numbers[seen], rows],
                FrameGeometry.of_rows(cameras, numbers[seen]),
                self._elapsed_s,
            )
            self._tracks = self._tracks.replaced(rows, corrected)
        track_of[new] = len(self._tracks) + np.arange(len(new))
        if len(new):
            geometry = FrameGeometry.of_rows(cameras, numbers[new])
            self._tracks = self._tracks.joined(init_tracks(observations[new], geometry))
        is_tracked = track_of >= 0
        self._seen, self._track_of = observations.rows[is_tracked], track_of[is_tracked]

    def _expected_boxes_px(self, cameras: Sequence[FrameGeometry]) -> Float64:
        """Return (C, T, 4) the predicted box of each track in each of C cameras, 0 behind it."""
        shape = (len(cameras), len(self._tracks))
        numbers, rows = (one.ravel() for one in np.indices(shape))
        geometry = FrameGeometry.of_rows(cameras, numbers)
        expected_px = expected_boxes_px(self._tracks[rows], geometry, numbers)
        return np.nan_to_num(expected_px).reshape(*shape, 4)

    def _costs(
        self, observations: VehicleObservations, expected_px: Float64, deviations_px: Float64
    ) -> Float64:
        """Return (T, D) the costs of continuing tracks by detections; infinite where a track cannot go on so.

        Args:
            observations: D detections.
            expected_px: (T, D, 4) predicted box of each track in the camera of each detection.
            deviations_px: (T, D, 4) standard deviations of the sides of these.
        """
        tracks, types = self._tracks, self._types(self._tracks)
        detections = observations.detections
        shape = expected_px.shape[:2]
        on_ground, gate = position_distances(tracks, observations), motion_model.GATE
        is_near = on_ground <= gate
        # The returns in an image may be those of what hides the object: beyond the gate the cost of a place is constant.
        limits = np.where(observations.is_above, _MAX_GROUND_COST, gate)
        on_ground = np.minimum(np.nan_to_num(on_ground, nan=gate / 2), limits)
        # Cars in a row overlap much in the image, but differ in position and size.
        in_image = (((detections.boxes_px - expected_px) / deviations_px) ** 2).sum(axis=2)
        found_px = np.broadcast_to(detections.boxes_px, expected_px.shape)
        overlap = paired_iou_px(expected_px.reshape(-1, 4), found_px.reshape(-1, 4)).reshape(shape)
        # What has come far since the last frame need not overlap its old box.
        is_allowed = overlap >= _MIN_IOU
        is_allowed |= is_near & (in_image <= _IMAGE_GATE)
        likelihoods = observations.class_likelihoods
        kinds = (types[:, None] == self._classes).argmax(axis=1)
        by_class = 2 * (likelihoods.max(axis=1, keepdims=True) - likelihoods)[:, kinds].T
        # A van may be taken for a car, but no person for a vehicle.
        is_allowed &= (
            SizePriors.of(types).has_sides[:, None] == SizePriors.of(detections.types).has_sides
        )
        return np.where(is_allowed, in_image + on_ground + by_class, np.inf)

    def _side_deviations_px(self, expected_px: Float64) -> tuple[Float64, Float64]:
        """Return (C, T, 4) standard deviations of the sides of expected boxes, and (C, T) the share of the pose.

        What was hidden for a second may be a metre from where its last velocity takes it, which shifts its box across
        the image, as a turn that the pose lacks does: its share is that of the variance of the columns, but for the motion.
        """
        tracks = self._tracks
        sizes_px = np.maximum(expected_px[..., 2:] - expected_px[..., :2], _MIN_SIZE_PX)
        deviations_px = np.tile(_SIDE_DEVIATION_SHARE * sizes_px, 2)
        unseen_s = 0.0 if self._stamp_s is None else self._stamp_s - tracks.last_seen_s
        pose_m2 = self._sensor.noise(tracks.mean[:, :2]).trace(axis1=1, axis2=2)
        moved_m2 = (unseen_s * tracks.speed_deviations_m_s) ** 2
        px_per_m2 = (sizes_px[..., 1] / _heights_m(tracks)) ** 2
        columns_px2, by_pose_px2 = deviations_px[..., 0] ** 2, pose_m2 * px_per_m2
        across_px = np.sqrt(columns_px2 + (pose_m2 + moved_m2) * px_per_m2)
        deviations_px[..., ::2] = across_px[..., None]
        return deviations_px, by_pose_px2 / (by_pose_px2 + columns_px2)

    def _give_ids(
        self, frame_geometry: FrameGeometry, types: NDArray[np.str_], moving: Tracks
    ) -> Tracks:
        """Give ids to newly confirmed tracks; return the moving objects with their common ids and classes."""
        tracks = self._tracks
        is_new = (tracks.ids < 0) & (tracks.evidence >= self._config.min_confirmed_evidence)
        boxes = tracks.boxes_velo(tracks.sizes_m, frame_geometry.world_SE3_velo)
        known_m = np.where(tracks.is_located[:, None], boxes.bottom_m, np.nan)
        boxes = replace(boxes, bottom_m=known_m)
        ids, moving = self._shared_ids.share(
            frame_geometry.stamp_s, tracks.ids, is_new, boxes, moving
        )
        self._tracks = replace(tracks, ids=ids)
        return _classified(moving, self._tracks, types)

    def _types(self, tracks: VehicleTable) -> NDArray[np.str_]:
        """Return (T,) the likeliest class of each track; a person faster than a walker rides."""
        if not len(tracks):
            return np.array([], np.str_)
        types = self._likeliest(tracks.class_evidence)
        return np.where((tracks.riding_votes > 0) & (types == _WALKER), _RIDER, types)

    def _likeliest(self, evidence: Float64) -> NDArray[np.str_]:
        """Return (M,) the likeliest class by (M, C) evidence, of those that some source names."""
        is_named = np.isin(self._classes, list(self._named))
        posterior = np.where(is_named, evidence + log_shares(self._classes), -np.inf)
        return np.asarray(self._classes[posterior.argmax(axis=1)])

    def _with_classes(self, vehicles: Vehicles) -> Vehicles:
        """Return untracked vehicles with the classes by all names of those that were found from above."""
        above, in_image = vehicles.bev_types, names_in_images(vehicles)
        types = self._likeliest(class_likelihoods(in_image, above, self._classes))
        types = np.where((above == "") | (in_image == ""), vehicles.fused.detections.types, types)
        return vehicles.with_detections(types=types)

    def _with_tracks(
        self, vehicles: Vehicles, cameras: Sequence[FrameGeometry], types: NDArray[np.str_]
    ) -> Vehicles:
        """Return the detections with the ids, classes, motion and boxes of their tracks."""
        seen, tracks, frame_geometry = self._seen, self._tracks[self._track_of], cameras[0]
        ids, velocities_m_s = vehicles.ids.copy(), vehicles.velocities_m_s.copy()
        ids[seen], is_known = tracks.ids, is_velocity_known(tracks)
        moved = tracks[is_known].velocities_velo(frame_geometry.world_SE3_velo)
        velocities_m_s[seen[is_known]] = moved
        boxes = _tracked_boxes(vehicles.boxes, seen, tracks, frame_geometry, self._elapsed_s)
        geometry = FrameGeometry.of_rows(cameras, tracks.cameras)
        boxes_px = _blended_boxes_px(tracks, boxes[seen], geometry)
        covariances, deviations = self._uncertainty(vehicles, frame_geometry, types)
        return replace(
            vehicles,
            fused=_with_evidence(
                vehicles.fused, seen, types[self._track_of], replace(tracks, boxes_px=boxes_px)
            ),
            ids=ids,
            velocities_m_s=velocities_m_s,
            covariances=covariances,
            box_deviations=deviations,
            boxes=boxes,
            scan_existence=vehicles.fused.existence,
        )

    def _uncertainty(
        self, vehicles: Vehicles, frame_geometry: FrameGeometry, types: NDArray[np.str_]
    ) -> tuple[Float64, BoxDeviations]:
        """Return covariances and deviations of the detections, those of their tracks where there are any."""
        seen, tracks, pose = self._seen, self._tracks[self._track_of], frame_geometry.world_SE3_velo
        sizes = SizePriors.of(types[self._track_of])
        # One detection tells no more of an object with an id than of another.
        is_known = (tracks.ids >= 0) & (tracks.detections > 1)
        covariances, is_located = vehicles.covariances.copy(), tracks.is_located
        located = tracks[is_located]
        covariances[seen[is_located]] = tracked_covariances(
            covariances_velo(located.covariance, pose),
            located.boxes_velo(located.sizes_m, pose),
            sizes[is_located],
            is_known[is_located],
        )
        is_boxed = np.isfinite(vehicles.boxes.yaw_rad[seen])
        deviations = box_deviations(
            vehicles.boxes[seen], vehicles.point_counts[seen], sizes, is_known
        )
        deviations = replace(deviations, reversal=tracks.reversal)
        return covariances, vehicles.box_deviations.replaced(seen[is_boxed], deviations[is_boxed])


def _with_evidence(
    fused: FusedDetections, seen: Int, own_types: NDArray[np.str_], tracks: VehicleTable
) -> FusedDetections:
    """Return the detections with the existence, the class and the box in the image of their tracks."""
    existence, boxes_px = fused.existence.copy(), fused.detections.boxes_px.copy()
    types = fused.detections.types.astype(np.result_type(fused.detections.types, own_types))
    existence[seen], boxes_px[seen] = probability(tracks.evidence), tracks.boxes_px
    types[seen] = own_types
    detections = replace(fused.detections, types=types, boxes_px=boxes_px)
    return replace(fused, detections=detections, existence=existence)


def _heights_m(tracks: VehicleTable) -> Float64:
    return np.where(tracks.is_located, tracks.sizes_m[:, 2], ASSUMED_HEIGHT_M)


def _blended_boxes_px(
    tracks: VehicleTable, boxes: Boxes3D, frame_geometry: FrameGeometry
) -> Float64:
    """Return (T, 4) boxes between those in the image and the outlines of the 3D boxes where both agree.

    What hides a part of a vehicle cuts its box in the image, not its 3D box: a hidden side is where the outline ends.
    Returns of another object move the 3D box, not the one in the image. People fill their 3D boxes less than vehicles do.
    """
    boxes_px = tracks.boxes_px
    outlines_px = box_outlines_px(frame_geometry.image_P_velo, boxes, frame_geometry.image_size_px)
    sizes_px = np.maximum(boxes_px[:, 2:] - boxes_px[:, :2], _MIN_SIZE_PX)
    off_px = outlines_px - boxes_px
    agrees = (np.abs(off_px) <= _MAX_OUTLINE_SHARE * np.tile(sizes_px, 2)).all(axis=1)
    is_vehicle = tracks.sizes_m[:, 0] >= SMALL_LENGTH_M
    is_hidden = hidden_sides(boxes_px, tracks.anchors_px[:, 2], tracks.cameras)
    is_behind = is_hidden & (_OUTWARD * off_px > 0)
    weights = np.where(is_behind, 1.0, _OUTLINE_WEIGHT)
    weights *= (agrees & is_vehicle)[:, None]
    return np.asarray(boxes_px + weights * np.nan_to_num(off_px))


def _classified(moving: Tracks, vehicles: VehicleTable, types: NDArray[np.str_]) -> Tracks:
    """Return the moving objects with the class and the score of the vehicles that have their ids."""
    row_of = {vehicle: row for row, vehicle in enumerate(vehicles.ids.tolist()) if vehicle >= 0}
    rows = np.array([row_of.get(number, -1) for number in moving.ids.tolist()], np.int64)
    return replace(
        moving, types=np.append(types, "")[rows], scores=np.append(vehicles.scores, np.nan)[rows]
    )


def _tracked_boxes(
    boxes: Boxes3D,
    seen: Int,
    tracks: VehicleTable,
    frame_geometry: FrameGeometry,
    elapsed_s: float,
) -> Boxes3D:
    """Replace the boxes of single detections by those of their tracks.

    A detection that is located elsewhere than a well-known track was a moment ago has the points of another object.
    """
    unlocated_s = frame_geometry.stamp_s - tracks.last_located_s
    is_held = (unlocated_s - elapsed_s <= RELOCATE_AFTER_S) & is_velocity_known(tracks)
    is_found = tracks.is_located & ((unlocated_s == 0) | is_held)
    is_found &= np.isfinite(boxes.yaw_rad[seen])
    found = tracks[is_found]
    return boxes.replaced(
        seen[is_found], found.boxes_velo(found.sizes_m, frame_geometry.world_SE3_velo)
    )
