import json
from collections.abc import Iterable, Iterator
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from data import pipeline_results
from data.derived.motion_labels import label_drive_motion
from data.kitti.sequence import KittiSequence
from data.open_drive import open_drive
from data.results.command_config import CommandConfig
from data.results.documents import to_serializable
from data.results.evaluated import EvaluationDocument
from perception.cli.flags import ReportFlags
from perception.cli.main import main
from perception.errors import DriveError, UsageError
from perception.evaluation.config import ObjectMatchConfig
from perception.evaluation.ground import GroundMeasure, GroundReport
from perception.evaluation.obstacle_measure import ObstacleMeasure, ObstacleReport
from perception.evaluation.report import Measure, Report
from perception.geometry.boxes import points_inside
from perception.geometry.grids import LocalArea
from perception.types import (
    Drive,
    Float,
    Float64,
    Frame,
    Obstacles,
    PointState,
    PointTruth,
    Result,
    UInt8,
    Voxels,
)
from tests.faults import command, fault

AREA = LocalArea()
NO_VOXELS = Voxels(np.zeros((0, 3), np.float32), np.zeros(0, np.int64), 0.1)


@dataclass(frozen=True)
class Flat:
    """The ground as a level plane."""

    z_m: float = -1.73

    def height_m(self, xy_m: Float) -> Float64:
        return np.full(len(xy_m), self.z_m)

    def distance_m(self, points_velo: Float) -> Float64:
        return np.asarray(points_velo[:, 2] - self.z_m, np.float64)


def result_of(frame: Frame, states: UInt8) -> Result:
    return Result(frame, np.eye(4), Flat(), Obstacles(states, NO_VOXELS, NO_VOXELS))


def states_by_height(points_velo: Float) -> UInt8:
    """Call everything static that is 0.2 m over a level ground."""
    height_m = points_velo[:, 2] + 1.73
    states = np.where(height_m < 0.2, PointState.GROUND, PointState.STATIC).astype(np.uint8)
    states[~AREA.contains_xy(points_velo) | (height_m >= AREA.height_m)] = PointState.OUTSIDE
    return states


class LevelPipeline(nullcontext):
    """A pipeline that believes in a flat and motionless world."""

    def __init__(self, sensor: object, config: object) -> None:
        super().__init__(self)

    def stream(
        self, frames: Iterator[Frame], *, is_sequence: bool, snapshot_frames: int
    ) -> nullcontext[Iterator[Result]]:
        assert is_sequence
        assert snapshot_frames == 0
        return nullcontext(
            result_of(frame, states_by_height(frame.points_velo)) for frame in frames
        )


@pytest.fixture
def sequence_0000(kitti_root: Path) -> KittiSequence:
    drive = open_drive(kitti_root / "tracking", sequence="0000", images=False)
    assert isinstance(drive, KittiSequence)
    return drive


def knowing_results(drive: KittiSequence, frames: int) -> Iterator[Result]:
    """Yield what a pipeline would say that had read the labels of sequence 0000."""
    for index in range(frames):
        frame, labels = drive[index], drive.labels(index)
        states = states_by_height(frame.points_velo)
        moves = labels[np.isin(labels.track_ids, (0, 1, 2, 4, 12))].boxes_velo
        on_moving = points_inside(moves, frame.points_velo).any(axis=0)
        states[(states == PointState.STATIC) & on_moving] = PointState.MOVING
        yield result_of(frame, states)


def measure(drive: Drive, results: Iterable[Result], measure: Measure[Any]) -> Any:
    for result in results:
        index = result.frame.index
        labels = drive.labels(index) if drive.has_labels else None
        measure.update(result, labels, drive.point_truth(index))
    return measure.compute()


def measure_ground(drive: Drive, results: Iterable[Result]) -> GroundReport:
    return measure(drive, results, GroundMeasure(drive.sensor, AREA))


def measure_obstacles(drive: Drive, results: Iterable[Result]) -> ObstacleReport:
    motion = label_drive_motion(drive) if isinstance(drive, KittiSequence) else None
    return measure(drive, results, ObstacleMeasure(AREA, motion=motion))


def text_of(report: Report) -> str:
    return "\n\n".join(table.text() for table in report.tables())


def test_a_level_ground_under_real_labels(sequence_0000: KittiSequence):
    results = (result_of(sequence_0000[i], np.zeros(1, np.uint8)) for i in (0, 40, 80))
    report = measure_ground(sequence_0000, results)
    feet = [sequence_0000.labels(i).boxes_velo.bottom_m for i in (0, 40, 80)]
    by_hand = [np.abs(foot[AREA.contains_xy(foot), 2] + 1.73).mean() for foot in feet]
    assert not report.points
    assert report.mde.mde_m == pytest.approx(np.mean(by_hand), abs=1e-9)
    objects = report.mde.objects
    assert sum(metric.objects for metric in report.mde_by_range.values()) == objects
    assert sum(metric.objects for metric in report.mde_by_slice.values()) == objects
    assert set(report.to_json()) == {"mde", "mde_by_range", "mde_by_slice"}
    assert f"{report.mde.mde_m:.4f}" in report.tables()[0].text()


def test_who_knows_the_labels_misses_no_object(sequence_0000: KittiSequence):
    report = measure_obstacles(sequence_0000, knowing_results(sequence_0000, 12))
    counts = report.objects
    assert counts.moving > 12
    assert (counts.missed_objects, counts.missed_moving, counts.false_moving) == (0, 0, 0)
    assert [row["clusters"] for row in report.to_json()["false_clusters"].values()] == [0, 0, 0]
    assert "missed_moving" in report.to_json()
    assert "False moving clusters" in text_of(report)


def test_who_sees_no_motion_misses_it_and_a_ghost_is_false(sequence_0000: KittiSequence):
    frame = sequence_0000[3]
    states = states_by_height(frame.points_velo)
    static = result_of(frame, states)
    # A wall far from every labelled object, in view, is said to move.
    x, y, z = frame.points_velo[:, :3].T
    ghost = (np.abs(x - 20) < 1) & (np.abs(y + 8) < 1) & (np.abs(z) < 1)
    boxes = sequence_0000.labels(3).boxes_velo
    ghost &= ~points_inside(boxes, frame.points_velo, 2.0).any(axis=0)
    assert ghost.sum() > 20
    haunted = result_of(frame, np.where(ghost, PointState.MOVING, states).astype(np.uint8))
    report = measure_obstacles(sequence_0000, [static, haunted])
    counts = report.objects
    assert counts.missed_moving == counts.moving > 0
    assert counts.tracks_never_moving == counts.moving_tracks
    false = report.to_json()["false_clusters"]["1 points and more"]
    assert false["clusters"] >= 1
    assert false["per_frame"] == false["clusters"] / 2


def test_object_frames_have_obstacles_of_unknown_motion(kitti_root: Path):
    drive = open_drive(kitti_root / "object", images=False)
    frame = drive[0]
    results = [result_of(frame, states_by_height(frame.points_velo))]
    report = measure_obstacles(drive, results)
    assert not report.false_clusters
    assert report.objects.objects > 0
    assert report.objects.moving == report.objects.static == 0
    assert report.to_json()["objects_by_min_points"]["1 points and more"]["moving"] == 0
    assert "No motion of objects" in text_of(report)


class WithTruth:
    """A drive without labels whose every point is a road that does not move."""

    has_labels = False
    has_poses = True

    def __init__(self, drive: Drive) -> None:
        self.sensor = drive.sensor

    def point_truth(self, index: int) -> PointTruth:
        count = 4
        return PointTruth(
            np.array([40, 40, 10, 10]), np.zeros(count, int), np.array([0, 0, 1, 1], bool)
        )


def test_exact_truth_adds_figures_per_point(sequence_0000: KittiSequence):
    points = np.array([[4, 0, -1.7, 0], [12, 0, -1.7, 0], [12, 1, -1, 0], [12, 1, -0.9, 0]])
    frame = Frame(0, 0.0, points.astype(np.float32))
    states = np.array([1, 2, 3, 2], np.uint8)  # ground, static, moving, static
    drive = WithTruth(sequence_0000)
    ground = measure_ground(drive, [result_of(frame, states)])
    assert ground.mde is None
    metrics = ground.to_json()
    assert metrics["points"]["recall"] == 0.5
    assert metrics["points_by_range"]["0 to 5 m"]["recall"] == 1
    obstacles = measure_obstacles(drive, [result_of(frame, states)])
    metrics = obstacles.to_json()
    assert metrics["points_moving"]["recall"] == 0.5
    assert metrics["points_static"]["false_positives"] == 2
    assert "Moving and static points against exact truth" in text_of(obstacles)


@pytest.mark.parametrize("measure", ["ground", "obstacles"])
def test_the_command_prints_a_table_and_writes_the_same_as_json(
    kitti_root: Path, tmp_path: Path, monkeypatch, capsys, measure: str
):
    monkeypatch.setattr(pipeline_results, "Pipeline", LevelPipeline)
    out = tmp_path / "made" / "figures.json"
    words = [measure, str(kitti_root / "tracking"), "--sequence", "0000", "--frames", "3"]
    assert main(["evaluate", *words, "--json", str(out)]) == 0
    written = json.loads(out.read_text())
    assert written["measure"] == measure
    assert written["data"]["frames"] == 154
    assert written["data"]["first_frames"] == written["data"]["frames_evaluated"] == 3
    assert written["configuration"]["pipeline"]["area"]["ahead_m"] == 25
    assert set(written) >= {"split", "protocol", "results", "program"}
    printed = capsys.readouterr().out
    assert printed.startswith("0000: 3 of 154 frames, HDL-64E, method default")
    if measure == "ground":
        assert f"{written['results']['mde']['mde_m']:.4f}" in printed
    else:
        objects = written["results"]["objects"]
        assert objects["missed_moving"] == objects["moving"]
        assert written["protocol"]["values"]["objects"]["min_points"] == 20
    assert {path.name for path in out.parent.iterdir()} == {"figures.html", "figures.json"}


def test_a_drive_without_labels_is_an_error(kitti_root: Path):
    drive = kitti_root / "raw" / "2011_09_26" / "2011_09_26_drive_0005_sync"
    with fault(DriveError, advice="name `labels` in the drive.yaml of a folder"):
        command("evaluate", "ground", drive)


def test_numbers_out_of_range_are_an_error(kitti_root: Path):
    words = ["evaluate", "obstacles", kitti_root / "tracking", "--sequence", "0000"]
    with fault(UsageError, where="--frames", expected="at least 1", found="0"):
        command(*words, "--frames", "0")
    with fault(UsageError, expected="shares from 0 to 1", found="1.5"):
        command(*words, "--protocol.objects.moving-share", "1.5")
    with fault(UsageError, found="0"):
        ObjectMatchConfig(min_points=0)


def test_json_holds_what_numpy_and_nan_are():
    plain = to_serializable(
        {"a": np.array([1.5, np.nan]), "b": np.int64(3), "c": (Path("x"), None, True)}
    )
    assert plain == {"a": [1.5, None], "b": 3, "c": ["x", None, True]}
    assert json.loads(json.dumps(plain)) == plain


def test_a_failed_write_leaves_the_old_file(tmp_path: Path):
    path = tmp_path / "figures.json"
    path.write_text("old")
    document = EvaluationDocument("ground", {}, {"unwritable": object()}, None)
    with pytest.raises(TypeError):
        config = CommandConfig("evaluate ground", {})
        ReportFlags(json=path).publish("0000", GroundReport(), document, config)
    assert path.read_text() == "old"
