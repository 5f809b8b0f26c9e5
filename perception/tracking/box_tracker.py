"""Objects followed as boxes: the default tracker."""

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.spatial import cKDTree

from perception.geometry import se3
from perception.geometry.boxes import transform_boxes
from perception.geometry.footprints import Footprints
from perception.geometry.grids import LocalArea
from perception.tracking import motion_model
from perception.tracking.association import assign_optimally
from perception.tracking.fragments import join_fragments, lie_within
from perception.tracking.heading import (
    UNKNOWN_VARIANCE,
    HeadingRules,
    first_yaws,
    follow_shape,
    follow_way,
    wrap,
)
from perception.tracking.motion_model import MotionModel
from perception.tracking.remembered_size import (
    SizeRules,
    likely_sizes_m,
    remember,
    with_sides_swapped,
)
from perception.tracking.track_life import LifeRules, is_alive, is_confirmed, is_told, may_stand
from perception.tracking.track_table import TrackTable
from perception.tracking.visible_sides import (
    Reaches,
    from_world,
    place_centers,
    reaches,
    sensor_along,
    to_world,
)
from perception.types import Bool, Boxes3D, Float64, Int, Tracks


@dataclass(frozen=True)
class BoxTrackerRules:
    """Every choice of the tracker.

    Attributes:
        motion: how things move and are seen.
        heading: what tells a heading.
        size: what is believed of sizes.
        life: when a track is believed and when it ends.
        height_gain: share of the way to a new height that a track's height goes.
        fragment_margin_m: beyond a track's expected box, within which things are parts of one.
        fragment_share: of the points of the largest part, which another part may have at most.
        standing_margin_m: by which a standing thing may be larger than the track that it continues.
        stood_reach_m: from a standing thing of the scan before, within which one is the same.
        standing_share: of the size seen last that it must have.
    """

    motion: MotionModel = field(default_factory=MotionModel)
    heading: HeadingRules = field(default_factory=HeadingRules)
    size: SizeRules = field(default_factory=SizeRules)
    life: LifeRules = field(default_factory=LifeRules)
    height_gain: float = 0.3
    standing_margin_m: float = 0.5
    standing_share: float = 0.6
    stood_reach_m: float = 0.3
    fragment_margin_m: float = 0.3
    fragment_share: float = 0.5


class BoxTracker:
    """Follows things as boxes, placed by the sides that face the sensor."""

    def __init__(self, area: LocalArea | None = None, rules: BoxTrackerRules | None = None) -> None:
        """Begin without a track.

        Args:
            area: outside of which nothing is seen, so that what leaves it is gone; None for no end.
            rules: every choice.
        """
        self._area = area
        self._rules = rules or BoxTrackerRules()
        self._next_id = 0
        self.end_all()

    def end_all(self) -> None:
        """End all tracks; their ids are not used again."""
        self._tracks = TrackTable.empty()
        self._stood_m = np.zeros((0, 2))
        self._stamp_s: float | None = None

    def update(
        self, stamp_s: float, world_SE3_velo: Float64, moving: Footprints, standing: Footprints
    ) -> Tracks:
        """Take in what one scan shows and say where everything is that is tracked."""
        if self._stamp_s is None or stamp_s > self._stamp_s:
            elapsed_s = 0.0 if self._stamp_s is None else stamp_s - self._stamp_s
            self._stamp_s = stamp_s
            self._predict(elapsed_s)
            sensor_m = world_SE3_velo[:2, 3]
            new = self._continue_moving(moving.moved(world_SE3_velo), sensor_m)
            self._continue_standing(standing.moved(world_SE3_velo), sensor_m)
            self._begin(new, sensor_m)
            self._end(world_SE3_velo)
        return self._tell(self._stamp_s, world_SE3_velo)

    def _predict(self, elapsed_s: float) -> None:
        tracks = self._tracks
        headings = follow_way(tracks, elapsed_s, self._rules.heading)
        states = motion_model.predict(tracks.states, elapsed_s, self._rules.motion)
        turn_rad = np.abs(wrap(headings.yaw_rad - tracks.yaw_rad, np.pi))
        self._tracks = replace(
            with_sides_swapped(tracks, turn_rad > np.pi / 4),
            mean=states.mean,
            covariance=states.covariance,
            yaw_rad=headings.yaw_rad,
            yaw_variance=headings.variance,
        )

    def _continue_moving(self, things: Footprints, sensor_m: Float64) -> Footprints:
        """Let moving things continue tracks, the confirmed ones first; return those that continue none."""
        is_sure = self._tracks.is_confirmed
        things = join_fragments(
            things,
            self._hold(self._tracks[is_sure], things.centroids_m),
            self._rules.fragment_share,
        )
        for rows in (np.flatnonzero(is_sure), np.flatnonzero(~is_sure)):
            if len(things) and len(rows):
                costs, _ = self._distances(self._tracks[rows], things, sensor_m)
                pairs = assign_optimally(costs, costs <= self._rules.motion.gate)
                self._see(rows[pairs.tracks], things[pairs.detections], sensor_m, is_moving=True)
                things = things[pairs.unmatched_detections]
        return things

    def _hold(self, tracks: TrackTable, places_m: Float64) -> Bool:
        """Tell (T, F) which places lie within the boxes of which tracks, and a little around them."""
        sizes_m = likely_sizes_m(tracks, self._rules.size) + 2 * self._rules.fragment_margin_m
        return lie_within(places_m, tracks.mean[:, :2], sizes_m, tracks.yaw_rad)

    def _continue_standing(self, things: Footprints, sensor_m: Float64) -> None:
        """Let standing things continue confirmed tracks that nothing moving continued."""
        is_new = self._stood_not(things)
        rows = np.flatnonzero(may_stand(self._tracks, self._stamp, self._rules.life))
        if len(things) == 0 or len(rows) == 0:
            return
        tracks = self._tracks[rows]
        costs, seen = self._distances(tracks, things, sensor_m)
        room_m = likely_sizes_m(tracks, self._rules.size) + self._rules.standing_margin_m
        fits = (
            (seen.sizes_m <= room_m[:, None])
            & (seen.sizes_m >= self._rules.standing_share * tracks.recent_sizes_m[:, :1])
        ).all(axis=2)
        is_continued = tracks.moved_s < tracks.seen_s
        fits &= is_continued[:, None] | is_new
        pairs = assign_optimally(costs, fits & (costs <= self._rules.motion.gate))
        self._see(rows[pairs.tracks], things[pairs.detections], sensor_m, is_moving=False)

    def _stood_not(self, things: Footprints) -> Bool:
        """Tell which standing things were not there in the scan before, and remember them."""
        before, self._stood_m = self._stood_m, things.centroids_m
        if len(before) == 0 or len(things) == 0:
            return np.ones(len(things), bool)
        reach_m = self._rules.stood_reach_m
        away_m, _ = cKDTree(before).query(things.centroids_m, distance_upper_bound=reach_m)
        return np.asarray(~np.isfinite(away_m))

    def _distances(
        self, tracks: TrackTable, things: Footprints, sensor_m: Float64
    ) -> tuple[Float64, Reaches]:
        """Return (T, F) squared Mahalanobis distances, and how far the things reach for each track."""
        seen = reaches(things, tracks.yaw_rad, sensor_m)
        centers_m, noise = self._measure(tracks, seen, things.points[None])
        return motion_model.squared_distances(tracks.states, centers_m, noise), seen

    def _measure(self, tracks: TrackTable, seen: Reaches, points: Int) -> tuple[Float64, Float64]:
        """Return centres (T, F, 2) and their noise (T, F, 2, 2)."""
        rules = self._rules
        sizes_m = likely_sizes_m(tracks, rules.size)
        centers = place_centers(seen, sizes_m, rules.size.complete_angle_rad)
        # A box turns around the side that is seen: its centre swings as far as the hidden part is long.
        swing_rad = np.sqrt(np.minimum(tracks.yaw_variance, rules.motion.most_swing_rad**2))
        hidden_m = np.maximum(sizes_m[:, None] - seen.sizes_m, 0.0)
        swing_m = hidden_m[..., ::-1] / 2 * swing_rad[:, None, None]
        noise = motion_model.place_noise(
            motion_model.Doubts(seen.sizes_m, swing_m, centers.slack_m),
            points,
            tracks.yaw_rad[:, None],
            rules.motion,
        )
        return to_world(centers.along_left_m, tracks.yaw_rad), noise

    def _see(self, rows: Int, things: Footprints, sensor_m: Float64, *, is_moving: bool) -> None:
        """Correct each of some tracks by the thing that continues it."""
        if len(rows) == 0:
            return
        tracks = self._turned_by_shape(self._tracks[rows], things)
        low_m, high_m = things.extents_m(tracks.yaw_rad)
        along_m = sensor_along(sensor_m, tracks.yaw_rad)
        seen = Reaches(low_m[:, None], high_m[:, None], along_m)
        tracks = self._grown(tracks, seen)
        centers_m, noise = self._measure(tracks, seen, things.points[:, None])
        states = motion_model.correct(tracks.states, centers_m[:, 0], noise[:, 0])
        tracks = replace(
            tracks,
            mean=states.mean,
            covariance=states.covariance,
            heights_m=_creep(
                tracks.heights_m, things.high_m - things.low_m, self._rules.height_gain
            ),
            low_world_m=_creep(tracks.low_world_m, things.low_m, self._rules.height_gain),
            seen_s=np.full(len(rows), self._stamp),
            moved_s=np.full(len(rows), self._stamp) if is_moving else tracks.moved_s,
            sights=tracks.sights + is_moving,
            points=tracks.points + things.points,
        )
        tracks = replace(tracks, is_confirmed=is_confirmed(tracks, self._rules.life))
        self._tracks = self._tracks.replaced(rows, tracks)

    def _turned_by_shape(self, tracks: TrackTable, things: Footprints) -> TrackTable:
        headings = follow_shape(tracks, things, self._rules.heading)
        return replace(tracks, yaw_rad=headings.yaw_rad, yaw_variance=headings.variance)

    def _grown(self, tracks: TrackTable, seen: Reaches) -> TrackTable:
        """Remember the sizes; a box that grows does so behind the side that faces the sensor."""
        rules = self._rules.size
        before_m = likely_sizes_m(tracks, rules)
        is_complete = seen.is_complete(rules.complete_angle_rad)[:, 0]
        sizes_m, recent_m, complete = remember(tracks, seen.sizes_m[:, 0], is_complete, rules)
        grown = replace(tracks, sizes_m=sizes_m, recent_sizes_m=recent_m, complete_seen=complete)
        growth_m = likely_sizes_m(grown, rules) - before_m
        away_m = from_world(tracks.mean[:, :2], tracks.yaw_rad) - seen.sensor_m
        is_outside = np.abs(away_m) > before_m / 2
        shift_m = np.sign(away_m) * is_outside * growth_m / 2
        mean = tracks.mean.copy()
        mean[:, :2] += to_world(shift_m, tracks.yaw_rad)
        return replace(grown, mean=mean)

    def _begin(self, things: Footprints, sensor_m: Float64) -> None:
        """Begin a track with each thing that continues none and is no part of what is tracked."""
        sure = self._tracks[self._tracks.is_confirmed]
        is_part = self._hold(sure, things.centroids_m).any(axis=0)
        things = things[np.flatnonzero(~is_part)]
        if len(things) == 0:
            return
        count, rules = len(things), self._rules
        yaw_rad = first_yaws(things, sensor_m, rules.heading)
        low_m, high_m = things.extents_m(yaw_rad)
        seen = Reaches(low_m[:, None], high_m[:, None], sensor_along(sensor_m, yaw_rad))
        sizes_m, middle_m = high_m - low_m, to_world((low_m + high_m) / 2, yaw_rad)
        stamps_s = np.full(count, self._stamp)
        states = motion_model.begin(middle_m, np.zeros((count, 2, 2)), sizes_m, rules.motion)
        tracks = TrackTable(
            ids=self._next_id + np.arange(count),
            mean=states.mean,
            covariance=states.covariance,
            yaw_rad=yaw_rad,
            yaw_variance=np.full(count, UNKNOWN_VARIANCE),
            sizes_m=sizes_m,
            recent_sizes_m=np.repeat(sizes_m[:, None], 3, axis=1),
            complete_seen=np.zeros((count, 2), np.int64),
            heights_m=things.high_m - things.low_m,
            low_world_m=things.low_m,
            begun_s=stamps_s,
            begun_world_m=middle_m,
            seen_s=stamps_s,
            moved_s=stamps_s,
            sights=np.ones(count, np.int64),
            points=things.points,
            is_confirmed=np.zeros(count, bool),
        )
        centers_m, noise = self._measure(tracks, seen, things.points[:, None])
        states = motion_model.begin(centers_m[:, 0], noise[:, 0], sizes_m, rules.motion)
        self._next_id += count
        tracks = replace(tracks, mean=states.mean, covariance=states.covariance)
        tracks = replace(tracks, is_confirmed=is_confirmed(tracks, rules.life))
        self._tracks = self._tracks.joined(tracks)

    def _end(self, world_SE3_velo: Float64) -> None:
        """End the tracks that nobody has seen for too long, and those unseen beyond the area."""
        tracks = self._tracks
        is_doubled = self._hold(tracks, tracks.mean[:, :2]) & tracks.is_confirmed[:, None]
        is_doubled &= tracks.ids[:, None] < tracks.ids
        goes_on = is_alive(tracks, self._stamp, self._rules.life) & ~is_doubled.any(axis=0)
        if self._area is not None:
            places_velo = se3.transform_points(
                se3.inverse(world_SE3_velo),
                np.column_stack([self._tracks.mean[:, :2], self._tracks.low_world_m]),
            )
            goes_on &= self._area.contains_xy(places_velo) | (self._tracks.seen_s == self._stamp)
        self._tracks = self._tracks[goes_on]

    @property
    def _stamp(self) -> float:
        return 0.0 if self._stamp_s is None else self._stamp_s

    def _tell(self, stamp_s: float, world_SE3_velo: Float64) -> Tracks:
        """Report the tracks in the frame of the scan."""
        tracks = self._tracks[is_told(self._tracks, stamp_s, self._rules.life)]
        sizes_m = likely_sizes_m(tracks, self._rules.size)
        boxes_world = Boxes3D(
            np.column_stack([tracks.mean[:, :2], tracks.low_world_m]),
            np.column_stack([sizes_m, tracks.heights_m]),
            tracks.yaw_rad,
        )
        turn_rad = np.arctan2(world_SE3_velo[1, 0], world_SE3_velo[0, 0])
        return Tracks(
            ids=tracks.ids,
            boxes=transform_boxes(se3.inverse(world_SE3_velo), boxes_world),
            velocities_m_s=from_world(tracks.mean[:, 2:], np.full(len(tracks), turn_rad)),
            is_seen=np.asarray(tracks.seen_s == stamp_s),
        )


def _creep(before: Float64, now: Float64, gain: float) -> Float64:
    return np.asarray(before + gain * (now - before))
