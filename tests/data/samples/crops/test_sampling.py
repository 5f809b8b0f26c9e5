"""Candidates of labelled frames, and sets from which nothing can be learned."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from data.array_store import ArrayStore
from data.open_drive import open_drive
from data.samples.crops.config import CropSamplingConfig
from data.samples.crops.labelled_frames import CropConfig, LabelledFrames
from data.samples.crops.sampling import CropSet, collect_crops
from perception.detection.depthcn.crops import WindowKind
from perception.errors import DriveError, LabelError, ScanError, UsageError
from perception.geometry.box_overlap_px import iou_px
from tests.faults import fault


def opened(folder: Path, store: ArrayStore) -> LabelledFrames:
    return LabelledFrames([open_drive(folder)], CropConfig(), store)


@pytest.mark.parametrize("kind", ["metric", "box"])
def test_a_street_gives_its_car_and_its_pole(street: LabelledFrames, kind: WindowKind):
    street.config = CropConfig(window=kind)
    found = collect_crops(street, CropSamplingConfig(jittered_copies=0))
    of_frame = found[found.frames == 1]
    # The van is left out.
    assert sorted(of_frame.is_vehicle.tolist()) == [False, True]
    car, pole = of_frame[of_frame.is_vehicle], of_frame[~of_frame.is_vehicle]
    np.testing.assert_allclose(car.depths_m, 11.73, atol=0.3)
    np.testing.assert_allclose(pole.depths_m, 10.58, atol=0.3)
    np.testing.assert_allclose(car.boxes_px[0], street.scene(1).label_boxes_px[0], rtol=1e-6)
    assert np.isnan(pole.boxes_px).all()


def test_the_window_is_of_the_kind_that_was_asked_for(street: LabelledFrames):
    metric = collect_crops(street, CropSamplingConfig(jittered_copies=0)).windows_px
    width, height = (metric[:, 2:] - metric[:, :2]).T
    np.testing.assert_allclose(width / height, 112 / 66, rtol=1e-5)
    street.config = CropConfig(window="box")
    box = collect_crops(street, CropSamplingConfig(jittered_copies=0)).windows_px
    proposed = street.scene(0).boxes_px
    assert all((np.abs(proposed - window).max(axis=1) < 1e-3).any() for window in box)


def test_jittered_labels_stay_on_their_vehicle(street: LabelledFrames):
    street.config = CropConfig(window="box")
    found = collect_crops(street, CropSamplingConfig(jittered_copies=20, max_jitter=0.1))
    jittered = found[found.is_jittered]
    assert len(jittered) == 3 * 20
    assert jittered.is_vehicle.all()
    overlap = iou_px(jittered.windows_px.astype(float), jittered.boxes_px[:1].astype(float))
    assert 0.6 < overlap.min() < 0.9
    assert len(np.unique(jittered.windows_px, axis=0)) == 60


def test_the_same_seed_gathers_the_same(street: LabelledFrames):
    first, second = (
        collect_crops(street, CropSamplingConfig()),
        collect_crops(street, CropSamplingConfig()),
    )
    np.testing.assert_array_equal(first.windows_px, second.windows_px)
    other = collect_crops(street, CropSamplingConfig(), seed=1)
    assert (first.windows_px != other.windows_px).any()


def test_a_vehicle_with_few_returns_is_not_added(street: LabelledFrames):
    found = collect_crops(street, CropSamplingConfig(min_points=100_000))
    assert not found.is_jittered.any()


def test_progress_goes_through_all_frames(street: LabelledFrames):
    seen = []

    def progress(numbers):
        for number in numbers:
            seen.append(number)
            yield number

    collect_crops(street, CropSamplingConfig(), progress=progress)
    assert seen == [0, 1, 2]


@pytest.mark.parametrize(
    ("things", "found"),
    [
        pytest.param((), "no object", id="no object"),
        pytest.param(("Van",), "3 Van", id="no car"),
    ],
)
def test_a_set_without_a_car_is_refused(
    make_street: Callable[..., Path], store: ArrayStore, things: tuple[str, ...], found: str
):
    frames = opened(make_street(things=things), store)
    with fault(LabelError, "labels of 3 frames", "at least one Car", found):
        collect_crops(frames, CropSamplingConfig())


def test_a_frame_without_objects_is_no_fault(make_street: Callable[..., Path], store: ArrayStore):
    folder = make_street()
    (folder / "training/label_2/000001.txt").write_text("")
    found = collect_crops(opened(folder, store), CropSamplingConfig(jittered_copies=0))
    # Nobody says that the car is one, nor that the van shall be left out.
    assert found.is_vehicle[found.frames == 1].tolist() == [False] * 3


def test_an_unreadable_label_stops_even_where_frames_are_skipped(
    make_street: Callable[..., Path], store: ArrayStore
):
    folder = make_street()
    (folder / "training/label_2/000001.txt").write_text("Car nothing\n")
    with fault(LabelError, "000001.txt row 1", "15 columns", "2"):
        collect_crops(opened(folder, store), CropSamplingConfig(), on_bad_frame="skip")


def test_a_damaged_scan_stops_or_is_skipped(
    make_street: Callable[..., Path], store: ArrayStore, caplog
):
    folder = make_street()
    (folder / "training/velodyne/000001.bin").write_bytes(b"12345")
    with fault(ScanError, "000001.bin"):
        collect_crops(opened(folder, store), CropSamplingConfig())
    found = collect_crops(opened(folder, store), CropSamplingConfig(), on_bad_frame="skip")
    assert np.unique(found.frames).tolist() == [0, 2]
    assert "skipped frame 000001" in caplog.text


def test_no_frames_are_refused(store: ArrayStore):
    with fault(DriveError, expected="labelled frames", found="none"):
        collect_crops(LabelledFrames([], CropConfig(), store), CropSamplingConfig())


def test_an_impossible_config_is_refused():
    with fault(UsageError, "crop sampling"):
        CropSamplingConfig(max_jitter=0.5)


@pytest.mark.parametrize(
    ("is_vehicle", "lacking"),
    [
        ([], "vehicles that the LiDAR observes"),
        ([False, False], "vehicles that the LiDAR observes"),
        ([True], "negatives"),
    ],
)
def test_one_class_alone_is_refused(is_vehicle: list[bool], lacking: str):
    count = len(is_vehicle)
    one = CropSet(
        np.zeros(count, int), np.zeros((count, 4), np.float32), np.zeros(count, np.float32),
        np.array(is_vehicle, int) - 1, np.zeros((count, 4), np.float32), np.zeros(count, bool),
    )  # fmt: skip
    with fault(LabelError, "a set", f"crops of both classes, {lacking} among them"):
        one.require_both_classes("a set")
