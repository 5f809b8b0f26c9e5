"""One frame as it is drawn: the result of the pipeline, and every object once, whichever stage found it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Self

import numpy as np
from numpy.typing import NDArray

from perception.detection.config import DetectionConfig
from perception.render import palette
from perception.render.palette import Color
from perception.tracking.single_object.tracker import TrackedObject, TrackStatus
from perception.tracking.vehicles.duplicates import distinct_rows
from perception.types import ArrayTable, Bool, Boxes3D, Float64, Int, Result, Tracks, Vehicles

# Below this speed the velocity of a standing object is noise.
MIN_SPEED_M_S = 0.5


@dataclass(frozen=True)
class SelectedObject:
    """The object of the pipeline that a one-object tracker follows.

    Attributes:
        track_id: Id of its track or vehicle.
        tracked: Output of the one-object tracker.
    """

    track_id: int
    tracked: TrackedObject


@dataclass(frozen=True)
class SceneObjects(ArrayTable):
    """T objects in the LiDAR frame, each once.

    Attributes:
        ids: (T,) track ids, -1 of objects without a track.
        boxes: (T) 3D boxes; rows of NaN where the LiDAR has too few points.
        boxes_px: (T, 4) x1 y1 x2 y2 of the fused detection in the image of its camera, NaN without one.
        cameras: (T,) camera of `Frame.views` that this image is of.
        velocities_m_s: (T, 2) velocities over the ground along x and y, 0 where unknown.
        is_observed: (T,) whether the object was observed in this scan, or is predicted.
        is_moving: (T,) whether the object is drawn with speed and arrow.
        has_front: (T,) whether the heading is reliable, and the front is marked.
        types: (T,) class names, empty where unknown.
        scores: (T,) scores of the class, NaN where unknown.
        statuses: (T,) status of the selected object, empty of all others.
        colors: (T,) numbers of colours of the palette, -1 of objects without a track.
    """

    ids: Int
    boxes: Boxes3D
    boxes_px: Annotated[Float64, 4]
    cameras: Int
    velocities_m_s: Annotated[Float64, 2]
    is_observed: Bool
    is_moving: Bool
    has_front: Bool
    types: NDArray[np.str_]
    scores: Float64
    statuses: NDArray[np.str_]
    colors: Int

    @classmethod
    def of(
        cls,
        result: Result,
        display_score: float = DetectionConfig.display_score,
        selected: SelectedObject | None = None,
    ) -> Self:
        """Return the tracks, and the vehicles that no track stands for.

        Args:
            result: Output of the pipeline.
            display_score: Score from which a detected vehicle is drawn.
            selected: Object of the one-object tracker, which replaces the pipeline's, or None.
        """
        objects = cls.of_tracks(result.tracks)
        if result.vehicles is not None:
            objects = objects._with_vehicles(result.vehicles, display_score)
        return objects if selected is None else objects._with_selected(selected)

    @classmethod
    def of_tracked(cls, tracked: TrackedObject, track_id: int = 0) -> Self:
        """Return the object of a one-object tracker; no object without a box."""
        if tracked.box_velo is None:
            return cls.empty()
        is_lost = tracked.status is TrackStatus.LOST
        velocity_m_s = np.zeros(2) if is_lost else tracked.velocity_m_s
        is_observed = np.array([tracked.status is TrackStatus.SEEN])
        track = Tracks.unclassified(
            np.array([track_id]), tracked.box_velo, velocity_m_s[None], is_observed
        )
        return replace(cls.of_tracks(track), statuses=np.array([str(tracked.status)]))

    @classmethod
    def of_tracks(cls, tracks: Tracks) -> Self:
        """Return the objects of tracks; what is fast moves."""
        count = len(tracks)
        velocities_m_s = np.nan_to_num(tracks.velocities_m_s)
        is_moving = np.asarray(np.hypot(*velocities_m_s.T) >= MIN_SPEED_M_S)
        return cls(
            ids=tracks.ids,
            boxes=tracks.boxes,
            boxes_px=np.full((count, 4), np.nan),
            cameras=np.zeros(count, np.int64),
            velocities_m_s=velocities_m_s,
            is_observed=tracks.is_observed,
            is_moving=is_moving,
            has_front=is_moving,
            types=tracks.types,
            scores=tracks.scores,
            statuses=np.full(count, "", "<U9"),
            colors=np.where(tracks.ids >= 0, tracks.ids % len(palette.TRACKS), -1),
        )

    def _with_vehicles(self, vehicles: Vehicles, display_score: float) -> Self:
        """Add the vehicles from a score on; one with the id of a track gives it its box in the image."""
        found_px = vehicles.fused.detections.boxes_px
        rows = distinct_rows(vehicles, display_score)
        ids = vehicles.ids[rows]
        is_same = (ids[:, None] == self.ids) & (ids[:, None] >= 0)
        boxes_px, cameras = self.boxes_px.copy(), self.cameras.copy()
        found, track = np.nonzero(is_same)
        boxes_px[track], cameras[track] = found_px[rows[found]], vehicles.cameras[rows[found]]
        new = rows[~is_same.any(axis=1)]
        others = self.of_tracks(vehicles.as_tracks(new))
        others = replace(others, boxes_px=found_px[new], cameras=vehicles.cameras[new])
        return replace(self, boxes_px=boxes_px, cameras=cameras).joined(others)

    def _with_selected(self, selected: SelectedObject) -> Self:
        """Replace the object of an id by that of the one-object tracker, which knows no class."""
        chosen = self.of_tracked(selected.tracked, selected.track_id)
        if not len(chosen):
            return self
        is_same = self.ids == selected.track_id
        if is_same.any():
            same = self[np.flatnonzero(is_same)[:1]]
            chosen = replace(
                chosen,
                types=same.types,
                scores=same.scores,
                boxes_px=same.boxes_px,
                cameras=same.cameras,
            )
        return self[~is_same].joined(chosen)

    def in_camera(self, camera: int) -> Self:
        """Return the objects with the detections in the image of one camera of `Frame.views`."""
        is_own = self.cameras[:, None] == camera
        return replace(self, boxes_px=np.where(is_own, self.boxes_px, np.nan))

    def colors_of(self, ids: Int) -> list[Color]:
        """Return the colours of (K,) track ids; grey of one without a track."""
        numbers = dict(zip(self.ids.tolist(), self.colors.tolist(), strict=True))
        return [palette.track_color(numbers.get(track, -1)) for track in ids.tolist()]

    @property
    def has_box(self) -> Bool:
        """(T,) whether the object has a 3D box."""
        return np.asarray(np.isfinite(self.boxes.bottom_m).all(axis=1))

    @property
    def is_selected(self) -> Bool:
        """(T,) whether the object is that of the one-object tracker."""
        return np.asarray(self.statuses != "")

    @property
    def speeds_m_s(self) -> Float64:
        """(T,) speeds over ground in metres per second."""
        return np.asarray(np.hypot(*self.velocities_m_s.T))

    @property
    def distances_m(self) -> Float64:
        """(T,) horizontal distances of the boxes from the LiDAR, infinite without a box."""
        distances_m = np.hypot(*self.boxes.bottom_m[:, :2].T)
        return np.asarray(np.where(self.has_box, distances_m, np.inf))


@dataclass(frozen=True)
class Scene:
    """Content of the image of one frame.

    Attributes:
        result: Output of the pipeline.
        objects: (T) objects that are drawn.
        paths_velo: (K, 3) path of each object in the LiDAR frame, the oldest position first.
        ego_speed_m_s: Speed of the vehicle in metres per second, NaN where unknown.
        tracked: Output of the one-object tracker, or None.
    """

    result: Result
    objects: SceneObjects
    paths_velo: Sequence[Float64]
    ego_speed_m_s: float = float("nan")
    tracked: TrackedObject | None = None

    @classmethod
    def of(cls, result: Result, display_score: float = DetectionConfig.display_score) -> Self:
        """Return the scene of a single frame, without paths."""
        objects = SceneObjects.of(result, display_score)
        return cls(result, objects, [np.zeros((0, 3))] * len(objects))
