"""The writer of a run's report: facts, errors against labels, panels of a run without a video."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from data.report.label_errors import LabelErrors
from data.report.run_facts import RunFacts
from data.report.run_writer import RunReportWriter
from data.results.run_config import RunConfig
from data.results.run_writers import run_writers
from perception.errors import LabelError
from perception.geometry.grids import LocalArea
from perception.render.composition import Composition
from perception.sensor import HDL_64E
from perception.types import BoxDeviations, Boxes3D, Detections, FusedDetections, Labels, Vehicles
from tests.render.conftest import GROUND_Z, scene  # noqa: F401 - fixture

BOX_PX = np.array([[10.0, 10, 60, 60]])


def labels_at(height_m, types=("Car",)):
    """Return a car 10 m ahead at a height above the ground, 50 pixels high."""
    count = len(types)
    box = Boxes3D(
        np.tile([10.0, 0, GROUND_Z + height_m], (count, 1)), np.ones((count, 3)), np.zeros(count)
    )
    return Labels(
        types=np.array(types),
        boxes_px=np.tile(BOX_PX, (count, 1)),
        boxes_velo=box,
        truncation=np.zeros(count),
        occlusion=np.zeros(count, np.int64),
        track_ids=np.arange(count),
        dont_care_px=np.zeros((0, 4)),
    )


def with_car(result, score=0.9):
    """Return a result with the car detected in the image by one modality."""
    found = Detections(BOX_PX, np.array([score]), np.array(["Car"]))
    fused = FusedDetections(
        detections=found,
        existence=np.array([score]),
        dominant_modality=np.zeros(1, np.int64),
        source_indices=np.zeros((1, 3), np.int64),
    )
    nowhere = Boxes3D(np.full((1, 3), np.nan), np.full((1, 3), np.nan), np.full(1, np.nan))
    vehicles = Vehicles(
        fused=fused,
        ids=np.array([-1]),
        boxes=nowhere,
        distances_m=np.full(1, np.nan),
        velocities_m_s=np.full((1, 2), np.nan),
        covariances=np.full((1, 4, 4), np.nan),
        box_deviations=BoxDeviations.unknown(1),
        owners=np.full(len(result.frame.points_velo), -1),
    )
    return replace(result, vehicles=vehicles, modality_detections={"rgb": found})


@pytest.fixture
def drive():
    sensor = SimpleNamespace(rate_hz=10.0, name="HDL-64E")
    labels = [labels_at(0.1), labels_at(0.3)]
    return SimpleNamespace(
        sensor=sensor, is_sequence=True, has_labels=True, labels=lambda index: labels[index % 2]
    )


def test_errors_of_the_ground_are_distances_at_labels(scene):  # noqa: F811 - fixture
    errors = LabelErrors(LocalArea())
    errors.update(scene, labels_at(0.1))
    errors.update(scene, labels_at(0.1)[:0])
    first, second = errors.ground
    assert (first.frame, first.objects, first.mean_m) == (7, 1, pytest.approx(0.1))
    assert (second.objects, second.mean_m, second.max_m) == (0, None, None)
    assert errors.precision() == []


def test_precision_is_that_of_the_fused_and_of_each_detector(scene):  # noqa: F811 - fixture
    errors = LabelErrors(LocalArea())
    errors.update(with_car(scene), labels_at(0.1))
    errors.update(replace(with_car(scene), modality_detections={}), labels_at(0.1))
    fused, by_detector = errors.precision()
    assert fused.title == "Car, fused, IoU over 0.7"
    # With two objects there are two thresholds: recall 0 and 1/40.
    assert fused.curves["easy: 2.5 % of 2"][:3] == [1, 1, 0]
    assert [name.partition(":")[0] for name in by_detector.curves] == ["fused", "rgb"]


def test_labels_of_no_class_have_no_curves(scene):  # noqa: F811 - fixture
    errors = LabelErrors(LocalArea())
    errors.update(with_car(scene), labels_at(0.1, ("Tram",)))
    assert errors.precision() == []


def test_a_run_without_a_video_leaves_panels_and_facts(scene, drive, tmp_path):  # noqa: F811 - fixture
    writer = RunReportWriter(tmp_path, drive, Composition(), 400, has_video=False)
    for index in range(4):
        frame = replace(scene.frame, index=index, stamp_s=0.1 * index)
        writer.add(replace(scene, frame=frame, skipped=("maps",)), None)
    writer.close(is_complete=False)
    # Every second of 400 frames.
    names = sorted(path.name for path in (tmp_path / "panels").iterdir())
    assert names == [
        "000000-0-camera.jpg", "000000-1-from_above.jpg", "000002-0-camera.jpg", "000002-1-from_above.jpg",
    ]  # fmt: skip
    facts = RunFacts.read(tmp_path)
    assert (facts.period_s, facts.skipped, facts.panels) == (0.1, {"maps": 4}, {})
    assert [one.mean_m for one in facts.ground] == pytest.approx([0.1, 0.3, 0.1, 0.3])
    assert {"trifuse", "Python", "numpy", "system"} <= set(facts.versions)
    # The run stopped: there is no report before one is asked for.
    assert not (tmp_path / "report.html").exists()


def test_a_run_with_a_video_states_its_panels(scene, drive, tmp_path):  # noqa: F811 - fixture
    writer = RunReportWriter(tmp_path, drive, Composition(size_px=(800, 450)), 2, has_video=True)
    writer.add(scene, None)
    writer.close(is_complete=False)
    assert list(RunFacts.read(tmp_path).panels) == ["Camera", "From above"]
    assert not (tmp_path / "panels").exists()


def test_damaged_labels_do_not_end_a_run(scene, drive, tmp_path, caplog):  # noqa: F811 - fixture
    def labels(index):
        if index == 1:
            raise LabelError("label_02.txt", expected="numbers", found="words")
        return labels_at(0.1)

    drive.labels = labels
    writer = RunReportWriter(tmp_path, drive, Composition(), 2, has_video=True)
    for index in range(3):
        writer.add(replace(scene, frame=replace(scene.frame, index=index)), None)
    writer.close(is_complete=False)
    assert [one.frame for one in RunFacts.read(tmp_path).ground] == [0]
    (record,) = caplog.records
    assert record.getMessage().endswith("label_02.txt: expected numbers, found words")


def test_a_run_without_frames_leaves_no_page(drive, tmp_path):
    RunReportWriter(tmp_path, drive, Composition(), 2, has_video=True).close(is_complete=True)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("is_installed", [True, False])
def test_without_plotly_there_is_no_report(is_installed, monkeypatch, tmp_path, caplog):
    class Street(SimpleNamespace):
        def __len__(self):
            return 2

    street = Street(sensor=HDL_64E, is_sequence=True, has_labels=False)
    spec = object() if is_installed else None
    monkeypatch.setattr("data.report.page.find_spec", lambda name: spec)
    writers = list(run_writers(street, tmp_path, RunConfig(video=False), None))
    assert any(isinstance(one, RunReportWriter) for one in writers) is is_installed
    assert ("no report.html: " in caplog.text) is not is_installed
