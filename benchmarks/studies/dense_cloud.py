"""A pole in the merged cloud, by INS alone and after registration (Fig. 5.2)."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.studies.merged_frame import MergedFrameFlags, read_merged_frame
from benchmarks.studies.report import RESULTS, formatted_table, publish
from perception.errors import DriveError
from perception.geometry.grids import LocalArea
from perception.types import Bool, Float64, GroundModel, Int, UInt8

if TYPE_CHECKING:
    from perception.localization.scan_window import DenseCloud
    from perception.render.obstacle_plots import AgedPoints

_SPECS = {"points": "d", "scans apart [cm]": ".1f"}
_CELL_M = 0.1
_LOW_M, _HIGH_M = 0.3, 2.0
_LEVEL_M = 0.1
# A pole fills half a metre across, and there is nothing else within a metre and a half.
_INNER_CELLS, _OUTER_CELLS = 5, 15
_MIN_LEVELS, _MIN_POINTS, _MIN_SHARE = 12, 60, 0.8


def dense_cloud(
    drive: str,
    *,
    window: MergedFrameFlags,
    at: tuple[float, float] | None = None,
    out: Path = RESULTS / "dense-cloud.png",
) -> None:
    """Draw a pole in the merged cloud, by INS alone and after registration (Fig. 5.2).

    Example: trifuse study dense-cloud kitti/raw/2011_09_26/2011_09_26_drive_0005_sync --frame 77

    Args:
        drive: Folder of a drive with INS, or the word synthetic.
        at: Position x,y of the object in metres; else that of the most isolated pole.
        out: Figure; a JSON file with the numbers is written beside it.

    Raises:
        DriveError: The drive has no INS, or the frame no pole.
    """
    from perception.localization.scan_window import merge
    from perception.render.obstacle_plots import plot_aged_points

    opened = window.open(drive)
    merged = read_merged_frame(opened, window)
    by_ins, ground = merged.ins_window, merged.planes
    if len(by_ins) < len(merged.window):
        raise DriveError(
            opened.root, expected="INS poses, to compare with registration", found="none"
        )
    clouds = {
        "INS alone": merge(by_ins, merged.area),
        "thesis: BGF and ICP": merged.cloud,
        "default: GICP to a keyframe": merge(merged.odometry_window, merged.area),
    }
    place_m = np.array(at) if at else find_pole(merged.cloud, ground, merged.area)
    cutouts = {name: cut_out(cloud, ground, place_m) for name, cloud in clouds.items()}
    apart_cm = {name: 1e2 * disagreement_m(one) for name, one in cutouts.items()}
    title = f"Merged cloud of a thin object, {merged.title}"
    panels = {f"{name}\nscans {apart_cm[name]:.1f} cm apart": one for name, one in cutouts.items()}
    plot_aged_points(out, title, panels)
    place = f"{title}, at x {place_m[0]:.1f} m, y {place_m[1]:.1f} m"
    rows = {name: (len(one.age), apart_cm[name]) for name, one in cutouts.items()}
    publish(
        out,
        "Fig. 5.2",
        {"clouds": formatted_table(place, "", _SPECS, rows)},
        {
            **merged.conditions,
            "place_m": place_m,
            "scans apart": "RMS over the earlier scans of the distance between the median position "
            "of their points within 0.5 m of the place and that of the newest scan's",
        },
    )


def find_pole(cloud: "DenseCloud", ground: GroundModel, area: LocalArea) -> Float64:
    """Return (2,) x and y of the most isolated tall thin object that every scan of the cloud observed.

    Raises:
        DriveError: There is none.
    """
    import cv2

    height_m = ground.distance_m(cloud.points_velo)
    rows = (height_m > _LOW_M) & (height_m < _HIGH_M)
    xy_m = cloud.points_velo[rows, :2] + (area.behind_m, area.side_m)
    shape = (
        int((area.behind_m + area.ahead_m) / _CELL_M) + 1,
        int(2 * area.side_m / _CELL_M) + 1,
    )
    cells = np.ravel_multi_index(tuple((xy_m / _CELL_M).astype(int).T), shape)
    points = np.bincount(cells, minlength=shape[0] * shape[1]).astype(np.float64).reshape(shape)
    levels = _distinct_values_around(cells, (height_m[rows] / _LEVEL_M).astype(int), shape)
    scans = _distinct_values_around(cells, cloud.age[rows], shape)
    inner = cv2.boxFilter(points, -1, (_INNER_CELLS,) * 2, normalize=False)
    outer = cv2.boxFilter(points, -1, (_OUTER_CELLS,) * 2, normalize=False)
    is_pole = scans >= int(cloud.age.max()) + 1
    is_pole &= (levels >= _MIN_LEVELS) & (inner >= _MIN_POINTS)
    is_pole &= inner >= _MIN_SHARE * outer
    # Nothing around a cell may have been cropped.
    is_pole[:_OUTER_CELLS] = is_pole[-_OUTER_CELLS:] = False
    is_pole[:, :_OUTER_CELLS] = is_pole[:, -_OUTER_CELLS:] = False
    if not is_pole.any():
        raise DriveError(
            "study dense-cloud",
            expected="a pole near the vehicle in this frame",
            found="none",
            advice="choose another --frame, or give a position with --at",
        )
    # Of equally isolated cells, the one with most points is the pole's middle.
    score = np.where(is_pole, np.round(1 - inner / np.maximum(outer, 1), 2) - 1e-6 * inner, np.inf)
    cell = np.array(np.unravel_index(np.argmin(score), score.shape))
    return np.asarray((cell + 0.5) * _CELL_M - (area.behind_m, area.side_m))


def _distinct_values_around(cells: Int, values: Int | UInt8, shape: tuple[int, int]) -> Float64:
    """Count the distinct values within the inner square around each cell."""
    import cv2

    total = np.zeros(shape)
    for one in np.unique(values):
        layer = np.zeros(shape[0] * shape[1], np.uint8)
        layer[cells[values == one]] = 1
        total += cv2.dilate(layer.reshape(shape), np.ones((_INNER_CELLS, _INNER_CELLS), np.uint8))
    return total


def cut_out(
    cloud: "DenseCloud", ground: GroundModel, place_m: Float64, radius_m: float = 0.5
) -> "AgedPoints":
    """Return the points above the ground within a radius of a place (2,)."""
    from perception.render.obstacle_plots import AgedPoints

    offset_m = cloud.points_velo[:, :2] - place_m
    height_m = ground.distance_m(cloud.points_velo)
    is_inside: Bool = (np.hypot(*offset_m.T) < radius_m) & (height_m > _LOW_M)
    is_inside &= height_m < _HIGH_M
    points_m = np.column_stack([offset_m, height_m])[is_inside]
    return AgedPoints(points_m.astype(np.float32), cloud.age[is_inside])


def disagreement_m(points: "AgedPoints") -> float:
    """Return the RMS distance of the object's centre in the earlier scans from that in the newest scan."""
    ages = np.unique(points.age)
    centers_m = [np.median(points.points_m[points.age == age, :2], axis=0) for age in ages]
    offsets_m = np.array(centers_m[1:]) - centers_m[0]
    return float(np.sqrt(np.mean(np.sum(offsets_m**2, axis=1))))
