import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from data.derived import moving_methods
from data.derived.moving_truth import moving_truth
from data.open_drive import open_drive
from data.synthetic.drive import SyntheticDrive
from data.synthetic.writer import write_tracking
from perception.cli.main import main
from perception.datmo.detector import SegmentedScan
from perception.errors import DriveError, UsageError
from perception.evaluation.config import DatmoProtocol
from perception.evaluation.datmo_measure import DatmoComparison, DatmoMeasure
from perception.evaluation.objects import MotionState
from perception.sensor import VLP_16
from perception.types import Boxes3D, Drive, Frame, Obstacles, PointState, Result, Tracks, Voxels
from tests.faults import command, fault

FRAMES = 6
NO_VOXELS = Voxels(np.zeros((0, 3), np.float32), np.zeros(0, np.int64), 0.1)


class Flat:
    def height_m(self, xy_m):
        return np.full(len(xy_m), -1.73)

    def distance_m(self, points_velo):
        return points_velo[:, 2] + 1.73


def segmented(frame: Frame) -> tuple[Result, SegmentedScan]:
    states = np.zeros(len(frame.points_velo), np.uint8)
    result = Result(frame, np.eye(4), Flat(), Obstacles(states, NO_VOXELS, NO_VOXELS))
    scan = SegmentedScan(frame.stamp_s, frame.points_velo, states, Flat(), np.eye(4), np.eye(4))
    return result, scan


def knowing_tracks(drive: Drive, frames: int) -> Iterator[tuple[Frame, Tracks]]:
    """Yield what a tracker would say that knows everything around."""
    truth = moving_truth(drive, "all")
    for index in range(frames):
        frame = drive[index]
        scene = truth.scene(frame, 0.2)
        moves = scene.objects.motions == MotionState.MOVING
        yield (
            frame,
            Tracks.unclassified(
                scene.objects.track_ids[moves],
                scene.objects.boxes_velo[moves],
                scene.velocities_m_s[moves],
                np.ones(moves.sum(), bool),
            ),
        )


@pytest.fixture(scope="module")
def drive() -> SyntheticDrive:
    return SyntheticDrive(FRAMES, sensor=VLP_16, images=False)


def test_who_knows_the_truth_scores_one_and_who_errs_does_not(drive: SyntheticDrive):
    names, truth = ("knows", "is off", "idle"), moving_truth(drive, "all")
    measures = {name: DatmoMeasure(truth, DatmoProtocol(view="all")) for name in names}
    for frame, tracks in knowing_tracks(drive, FRAMES):
        boxes, aside_m = tracks.boxes, np.array([0.8, 0.0, 0.0])
        off = Boxes3D(boxes.bottom_m + aside_m, boxes.size_m, boxes.yaw_rad)
        predictions = (tracks, replace(tracks, boxes=off), Tracks.empty())
        for name, predicted in zip(names, predictions, strict=True):
            result = replace(segmented(frame)[0], tracks=predicted)
            measures[name].update(replace(result, timings_s={"moving objects": 0.002}))
    reports = {name: one.compute() for name, one in measures.items()}
    knows, is_off, idle = (reports[name] for name in names)
    assert knows.by_distance.hota.hota.mean() == knows.by_overlap.clear.mota == 1.0
    assert knows.never_tracked == []
    assert knows.frames == FRAMES
    assert knows.duration_s == pytest.approx(0.6)
    assert is_off.to_json()["errors"]["center_m"] == pytest.approx(0.8)
    assert is_off.by_distance.clear.motp == pytest.approx(0.6)
    assert is_off.by_overlap.hota.hota.mean() < 0.8
    assert idle.by_distance.clear.mota == 0.0
    assert len(idle.never_tracked) == idle.count_never_tracked == len(idle.objects) >= 2
    assert knows.objects.keys() == idle.objects.keys()
    for row in idle.by_length.values():
        assert row.never_tracked == row.objects
        assert np.isnan([row.ids_per_object, row.moving_iou]).all()
    assert len(idle.false_tracks.ids) == len(is_off.false_tracks.ids) == 0
    tables = {table.title: table.text() for table in DatmoComparison(reports).tables()}
    assert "Objects that must be tracked: is off" in tables
    assert "2.0" in tables["Objects that no track matched, and time"]


def test_results_of_the_pipeline_are_measured_the_same(drive: SyntheticDrive):
    measure = DatmoMeasure(moving_truth(drive))
    for frame, tracks in knowing_tracks(drive, FRAMES):
        result = replace(segmented(frame)[0], tracks=tracks)
        measure.update(replace(result, timings_s={"moving objects": 0.004}))
    report = measure.compute()
    assert report.protocol.view == "camera"
    assert report.by_distance.hota.hota.mean() == 1.0
    assert report.ms_per_frame == report.ms_p99 == pytest.approx(4.0)


@pytest.mark.parametrize(("second_id", "ids"), [(0, 1.0), (100, 2.0)], ids=["kept", "changed"])
def test_ids_and_moving_points_are_measured_by_the_length_of_the_object(
    drive: SyntheticDrive, second_id: int, ids: float
):
    measure = DatmoMeasure(moving_truth(drive, "all"), DatmoProtocol(view="all"))
    for frame, tracks in knowing_tracks(drive, FRAMES):
        points, result = drive.point_truth(frame.index), segmented(frame)[0]
        states = np.where(points.is_moving, PointState.MOVING, PointState.STATIC)
        obstacles = Obstacles(states.astype(np.uint8), NO_VOXELS, NO_VOXELS)
        ids_now = tracks.ids + second_id * (frame.index % 2)
        result = replace(result, tracks=replace(tracks, ids=ids_now), obstacles=obstacles)
        measure.update(result, truth=points)
    report = measure.compute()
    assert {"2 to 6 m"} <= report.by_length.keys() <= {"under 2 m", "2 to 6 m", "over 6 m"}
    assert sum(row.objects for row in report.by_length.values()) == len(report.objects)
    for row in report.by_length.values():
        assert (row.never_tracked, row.ids_per_object, row.moving_iou) == (0, ids, 1.0)


class LevelChain:
    def __init__(self, sensor: object, config: object) -> None:
        pass

    def segment(self, frame: Frame) -> tuple[Result, SegmentedScan]:
        return segmented(frame)


class Remembering:
    """A stage that was told the tracks of every scan."""

    def __init__(self, predictions: list[Tracks]) -> None:
        self._predictions = iter(predictions)

    def update(self, scan: SegmentedScan) -> Tracks:
        return next(self._predictions)


def test_the_command_compares_methods_and_writes_the_same_as_json(
    drive: SyntheticDrive, tmp_path: Path, monkeypatch, capsys
):
    folder = write_tracking(drive, tmp_path / "drive", 0, lambda: None)
    predictions = [tracks for _, tracks in knowing_tracks(open_drive(folder), FRAMES)]
    monkeypatch.setattr(moving_methods, "LidarStages", LevelChain)
    monkeypatch.setattr(
        moving_methods,
        "datmo_stage",
        lambda config, sensor, area: (
            Remembering(predictions) if config.method == "default" else None
        ),
    )
    out = tmp_path / "figures.json"
    words = ["datmo", str(folder), "--protocol.view", "all", "--methods", "thesis,default"]
    assert (
        main(["evaluate", *words, "--protocol.targets.min-points", "10", "--json", str(out)]) == 0
    )
    printed = capsys.readouterr().out
    assert printed.startswith(f"0000: {FRAMES} of {FRAMES} frames, VLP-16")
    written = json.loads(out.read_text())
    assert written["measure"] == "datmo"
    assert written["protocol"]["values"]["targets"]["min_points"] == 10
    assert written["data"]["frames_evaluated"] == FRAMES
    results = written["results"]
    assert list(results) == ["thesis", "default", "poses"]
    assert results["poses"]["up to 1 s"]["frames"] == FRAMES - 1
    assert "Poses since the first scan" in printed
    assert results["default"]["by_distance"]["HOTA"] == 1.0
    assert results["default"]["never_tracked"] == []
    assert results["thesis"]["by_overlap"]["MOTA"] == 0.0
    assert {int(number) for number in results["thesis"]["objects"]} == set(
        results["thesis"]["never_tracked"]
    )
    assert "Objects that must be tracked: thesis" in printed
    assert "By length of the object: thesis" in printed
    rows = results["default"]["by_length"].values()
    assert sum(row["objects"] for row in rows) == len(results["default"]["objects"])


def test_labels_of_the_camera_do_not_cover_the_whole_scan(kitti_root: Path):
    with fault(DriveError, expected="labels of all objects", advice="--protocol.view camera"):
        command(
            "evaluate",
            "datmo",
            kitti_root / "tracking",
            "--sequence",
            "0000",
            "--protocol.view",
            "all",
        )


@pytest.mark.parametrize("methods", ["", "thesis,thesis"])
def test_methods_are_named_once(kitti_root: Path, methods):
    with fault(UsageError, where="--methods", expected="default, thesis, author", found=methods):
        command(
            "evaluate", "datmo", kitti_root / "tracking", "--sequence", "0000", "--methods", methods
        )


def test_object_frames_have_no_tracks(kitti_root: Path):
    with fault(DriveError, advice="such as a tracking sequence"):
        command("evaluate", "datmo", kitti_root / "object")
