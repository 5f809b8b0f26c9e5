"""The figures of `trifuse evaluate obstacles`, for people and for programs."""

from collections.abc import Mapping
from typing import Any

from perception.cli.evaluations.obstacle_report import ObstacleReport
from perception.cli.table import Cell, format_table, percent
from perception.evaluation.confusion import confusion_table
from perception.evaluation.false_clusters import is_false
from perception.evaluation.obstacles import ObjectCounts, missed_moving

_OBJECT_HEADER = (
    "objects",
    "missed",
    "share",
    "moving",
    "called static",
    "tracks",
    "never found",
    "static",
    "called moving",
)


def obstacle_tables(report: ObstacleReport) -> str:
    """Return the figures for people."""
    tables = [*_object_tables(report), *_cluster_tables(report), *_shadow_tables(report)]
    if report.points is not None:
        points = {"moving": report.points.moving, "static": report.points.static}
        tables.append(
            confusion_table("Points called moving or static, against exact truth", points).text()
        )
    return "\n\n".join([*tables, *_what_is_missing(report)])


def _what_is_missing(report: ObstacleReport) -> list[str]:
    """Say which figures the drive does not allow."""
    if report.observed is None:
        return ["No objects: the drive has no labelled boxes."]
    if not report.has_motion:
        return ["No motion of objects: it takes tracks and INS poses to tell what moves."]
    if report.clusters is None:
        return ["No false moving clusters: it takes images to tell what the camera sees."]
    return []


def _object_tables(report: ObstacleReport) -> list[str]:
    if report.observed is None:
        return []
    config = report.protocol.objects
    by_points = {
        f"{counts.min_points} points and more": counts for counts in report.counts_by_min_points()
    }
    return [
        _object_table(
            f"Labelled objects, once a frame; found to move at {100 * config.moving_share:g} % of points",
            by_points,
        ),
        _object_table(
            f"Of {config.min_points} points and more, by share of points that must move",
            report.counts_by_moving_share(),
        ),
        _object_table(
            f"Of {config.min_points} points and more, by frames", report.counts_by_warm_up()
        ),
    ]


def _object_table(title: str, counts: Mapping[str, ObjectCounts]) -> str:
    rows: list[list[Cell]] = [
        [
            name,
            c.objects,
            c.missed_objects,
            percent(c.missed_objects, c.objects),
            c.moving,
            c.missed_moving,
            c.moving_tracks,
            c.tracks_never_moving,
            c.static,
            c.false_moving,
        ]
        for name, c in counts.items()
    ]
    return format_table(title, ("", *_OBJECT_HEADER), rows)


def _cluster_tables(report: ObstacleReport) -> list[str]:
    if report.clusters is None:
        return []
    rows: list[list[Cell]] = [
        [
            f"{false.min_points} points and more",
            false.clusters,
            false.per_frame,
            false.on_static_objects,
            false.in_warm_up,
            false.with_dont_care,
        ]
        for false in report.false_clusters()
    ]
    first = f"in first {report.protocol.warm_up}"
    header = ("", "clusters", "a scan", "on static objects", first, "with DontCare")
    return [format_table("False moving clusters in the camera's view", header, rows)]


def _shadow_tables(report: ObstacleReport) -> list[str]:
    if report.shadows is None:
        return []
    counts = {"shadows": report.shadows.clusters, "voxels in them": report.shadows.voxels}
    rows: list[list[Cell]] = [
        [name, int(count.sum()), float(count.mean())] for name, count in counts.items()
    ]
    title = "False static obstacles: shadows of moving objects, in the camera's view"
    return [format_table(title, ("", "all", "a scan"), rows)]


def obstacle_results(report: ObstacleReport) -> dict[str, Any]:
    """Return the figures for programs."""
    results: dict[str, Any] = {}
    results["missing"] = _what_is_missing(report)
    if report.observed is not None:
        results["objects"] = report.counts()
        results["objects_by_min_points"] = report.counts_by_min_points()
        results["objects_by_moving_share"] = report.counts_by_moving_share()
        results["objects_by_warm_up"] = report.counts_by_warm_up()
        results["missed_moving"] = missed_moving(report.observed, report.protocol.objects)
    if report.clusters is not None:
        protocol = report.protocol
        false = is_false(
            report.clusters, protocol.cluster_points, protocol.clusters, ignore_dont_care=True
        )
        results["false_clusters"] = report.false_clusters()
        results["false_cluster_places"] = report.clusters[false]
    if report.shadows is not None:
        results["shadows"] = int(report.shadows.clusters.sum())
        results["shadow_voxels"] = int(report.shadows.voxels.sum())
        results["shadows_per_frame"] = float(report.shadows.clusters.mean())
    if report.points is not None:
        results["points_moving"] = report.points.moving.to_json()
        results["points_static"] = report.points.static.to_json()
    return results
