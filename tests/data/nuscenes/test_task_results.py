"""Results of the pipeline in nuScenes' form, and labelled frames of other drives as its samples."""

import json
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from data import labelled_drives
from data.derived.motion_labels import TrackPositions
from data.detections.measured_drives import DriveReader
from data.exports.nuscenes_writer import NuScenesWriter
from data.labelled_objects import task_classes
from data.layouts import OpenConfig
from data.measured_task import measure_task_drives, measure_task_results
from data.nuscenes.result_entries import ResultEntries
from data.nuscenes.samples import central_velocities, read_samples
from data.open_drive import open_drive
from data.recorded_drive import RecordedDrive
from data.result_files import find_results
from perception.detection.config import DetectionConfig
from perception.types import BoxDeviations, Boxes3D, Detections, FusedDetections, Result, Vehicles
from tests.known_result import known_result
from tests.other_layouts import write_nuscenes
from tests.tiny_drive import TinyDrive


class FiveFrames(TinyDrive):
    """Key frame, sweep, key frame, sweep, key frame."""

    def __len__(self) -> int:
        return 5


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> RecordedDrive:
    root = write_nuscenes(tmp_path_factory.mktemp("scene"), FiveFrames())
    return open_drive(root, sequence="scene-0061", config=OpenConfig(images=False))


def found(drive: RecordedDrive, index: int, **columns: np.ndarray) -> Result:
    """Return a result whose vehicles are the labels of a frame, 0.75 m too far."""
    labels = drive.labels(index)
    count = len(labels)
    detections = Detections(labels.boxes_px, np.linspace(0.9, 0.5, count), labels.types)
    vehicles = Vehicles(
        FusedDetections.unfused(detections),
        ids=labels.track_ids,
        boxes=replace(
            labels.boxes_velo, bottom_m=labels.boxes_velo.bottom_m + np.array([0.75, 0, 0])
        ),
        distances_m=np.full(count, np.nan),
        velocities_m_s=np.full((count, 2), np.nan),
        covariances=np.full((count, 4, 4), np.nan),
        box_deviations=BoxDeviations.unknown(count),
        owners=np.zeros(0, np.int64),
    )
    result = known_result(index)
    return replace(result, frame=drive[index], vehicles=replace(vehicles, **columns))


def test_the_entries_of_a_key_frame(scene):
    entries = ResultEntries(scene)
    entries.add(found(scene, 0, velocities_m_s=np.array([[3.0, 4.0]])))
    entries.add(found(scene, 1))
    entries.add(found(scene, 2))
    document = json.loads(json.dumps(entries.document()))
    assert document["meta"] == {
        "use_camera": True, "use_lidar": True, "use_radar": False, "use_map": False, "use_external": True,
        "drive": "scene-0061",
    }  # fmt: skip
    assert list(document["results"]) == ["sample-0", "sample-2"]  # no sweep
    (first,), (last,) = document["results"].values()
    # The label lies 12 m ahead of the LiDAR, which is 1.75 m high; its bottom 1.5 m below.
    np.testing.assert_allclose(first["translation"], [12.75, 0, 1.75 - 1.5 + 0.75], atol=1e-3)
    np.testing.assert_allclose(first["size"], [1.75, 4, 1.5])
    np.testing.assert_allclose(first["rotation"], [1, 0, 0, 0], atol=1e-6)
    assert (first["detection_name"], first["detection_score"]) == ("car", 0.9)
    assert (first["velocity"], first["attribute_name"]) == ([3.0, 4.0], "vehicle.moving")
    # Nothing is known of its velocity, but it has moved before.
    assert (last["velocity"], last["attribute_name"]) == ([0.0, 0.0], "vehicle.stopped")


@pytest.mark.parametrize(
    ("kind", "speed_m_s", "name", "attribute"),
    [
        ("Van", 0.4, "car", "vehicle.parked"),
        ("Truck", 0.6, "truck", "vehicle.moving"),
        ("Pedestrian", 0.6, "pedestrian", "pedestrian.moving"),
        ("Person_sitting", np.nan, "pedestrian", "pedestrian.standing"),
        ("Cyclist", 3.0, "bicycle", "cycle.with_rider"),
        ("bicycle", 0.0, "bicycle", "cycle.without_rider"),
        ("Traffic cone", 0.0, "traffic_cone", ""),
        ("Tram", 0.0, None, None),
    ],
)
def test_classes_and_attributes(scene, kind, speed_m_s, name, attribute):
    entries, result = ResultEntries(scene), found(scene, 0, velocities_m_s=np.array([[0, speed_m_s]]))  # fmt: skip
    assert result.vehicles is not None
    fused = result.vehicles.fused
    named = replace(fused, detections=replace(fused.detections, types=np.array([kind])))
    entries.add(replace(result, vehicles=replace(result.vehicles, fused=named)))
    made = entries.document()["results"]["sample-0"]
    stated = [(one["detection_name"], one["attribute_name"]) for one in made]
    assert stated == ([] if name is None else [(name, attribute)])


def test_a_vehicle_without_a_box_is_left_out(scene):
    entries = ResultEntries(scene)
    unknown = Boxes3D(np.full((1, 3), np.nan), np.full((1, 3), np.nan), np.full(1, np.nan))
    entries.add(found(scene, 0, boxes=unknown))
    entries.add(replace(found(scene, 2), vehicles=None))
    assert entries.document()["results"] == {"sample-0": [], "sample-2": []}


def test_a_resumed_run_writes_the_same_file(scene, tmp_path):
    whole, first, second = (NuScenesWriter(tmp_path / name, scene) for name in ("a.json", "b.json", "b.json"))  # fmt: skip
    results = [found(scene, 0, velocities_m_s=np.ones((1, 2))), found(scene, 2), found(scene, 4)]
    for result in results:
        whole.add(result, None)
    first.add(results[0], None)
    second.restore(first.snapshot())
    for result in results[1:]:
        second.add(result, None)
    whole.close(is_complete=True)
    second.close(is_complete=False)
    assert (tmp_path / "a.json").read_bytes() == (tmp_path / "b.json").read_bytes()


@pytest.mark.parametrize("name", ["nuScenes", "KITTI"])
def test_a_file_has_the_metrics_of_its_run(name, scene, tracking_street, tmp_path, monkeypatch):
    root = scene.root if name == "nuScenes" else tracking_street

    def results(drive: RecordedDrive, *_: object, **__: object) -> Iterator[Result]:
        return (found(drive, index) for index in range(len(drive)))

    monkeypatch.setattr(labelled_drives, "pipeline_results", results)
    reader = DriveReader(sequence="scene-0061" if name == "nuScenes" else "0000")
    measured, document = measure_task_drives([root], reader, DetectionConfig())
    ((info, report),) = measured.drives
    assert info.frames_evaluated == (3 if name == "nuScenes" else 4)
    assert document.protocol["name"].startswith("nuScenes detection task")
    # All are found 0.75 m too far.
    car = report.classes["car"]
    assert car.objects > 0
    assert car.ap_by_distance["0.5"] < car.ap_by_distance["1.0"]
    assert car.trans_err == pytest.approx(0.75, abs=1e-3)

    drive = open_drive(root, sequence=reader.sequence, config=OpenConfig(images=False))
    writer = NuScenesWriter(tmp_path / "results.json", drive)
    for index in range(len(drive)):
        writer.add(found(drive, index), None)
    writer.close(is_complete=True)
    _, again, _ = measure_task_results(find_results(tmp_path / "results.json"), root)
    assert json.dumps(again.to_json()) == json.dumps(report.to_json())


def test_samples_of_a_drive_with_labels(tracking_street):
    drive = open_drive(tracking_street, sequence="0000", config=OpenConfig(images=False))
    samples = read_samples(drive)
    assert [one.token for one in samples] == ["000000", "000001", "000002", "000003"]
    first, second = (one.truths for one in samples[:2])
    labels = drive.labels_around(0) if hasattr(drive, "labels_around") else drive.labels(0)
    assert first.types.tolist() == task_classes(labels.types.tolist()).tolist()
    assert first.has_points.any()
    # From the first to the second frame, and back.
    step_m = second.centers_m[0, :2] - first.centers_m[0, :2]
    elapsed_s = drive.stamp_s(1) - drive.stamp_s(0)
    np.testing.assert_allclose(first.velocities_m_s[0], step_m / elapsed_s, atol=1e-6)
    assert len(read_samples(drive, [2])) == 1


def test_velocities_are_central_within_reach():
    stamps_s = np.array([0.0, 1.0, 2.5, 0.0, 1.6, 9.0, 0.0, 1.4, 3.2])
    places_m = np.zeros((9, 3))
    places_m[:, 0] = [0, 1, 5, 0, 8, 0, 0, 7, 16]
    ids = np.array([1, 1, 1, 2, 2, 3, 4, 4, 4])
    order = np.array([4, 0, 8, 2, 6, 1, 3, 5, 7])
    positions = TrackPositions(ids[order], stamps_s[order], ids[order], places_m[order])
    velocities = np.empty((9, 2))
    velocities[order] = central_velocities(positions)
    nan = np.nan
    # One-sided within 1.5 s, two-sided within 3 s.
    expected = [1, 2, 4 / 1.5, nan, nan, nan, 5, nan, nan]
    np.testing.assert_allclose(velocities[:, 0], expected)
    none = np.zeros(0, np.int64)
    assert len(central_velocities(TrackPositions(none, none / 1.0, none, np.zeros((0, 3))))) == 0


def test_every_class_has_one_category_of_each_set():
    from data.argoverse2.annotations import CATEGORIES as ARGOVERSE
    from data.nuscenes.boxes import category
    from perception.evaluation.nuscenes.protocol import CLASSES

    assert category("vehicle.bus.bendy").task_class == "bus"
    assert category("human.pedestrian.child").task_class == "pedestrian"
    not_counted = ("human.pedestrian.stroller", "human.pedestrian.personal_mobility", "human.pedestrian.wheelchair",
                   "vehicle.emergency.police", "vehicle.emergency.ambulance", "animal", "static_object.bicycle_rack",
                   "movable_object.debris")  # fmt: skip
    assert {category(name).task_class for name in not_counted} == {None}
    known = {one.task_class for one in ARGOVERSE.values()} - {None}
    assert known == set(CLASSES) - {"construction_vehicle", "barrier"}
