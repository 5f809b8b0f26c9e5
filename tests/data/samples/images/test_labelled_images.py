"""Pictures of frames: right, kept, bounded, and made anew where anything changes."""

import logging
import os
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from data.array_store import ArrayStore
from data.label_proposals.proposals import Proposal, ProposalFile
from data.label_proposals.proposed_labels import ProposedLabels
from data.open_drive import open_drive
from data.samples.images import labelled_images
from data.samples.images.input_images import ImageConfig
from data.samples.images.labelled_images import LabelledImages
from data.synthetic.collection import SynthConfig, write_drives
from perception.detection.detectors.input_size import InputSize
from perception.detection.detectors.modalities import (
    fill_maps,
    map_image,
    modality_image,
)
from perception.detection.detectors.modality_detector import ModalityDetector
from perception.detection.detectors.network_input import PixelRectangle, place, prepare_image
from perception.errors import ImageError, LabelError, ScanError, UsageError
from perception.geometry.camera import box_outlines_px
from perception.maps.projection import project_frame
from perception.sensor import VLP_16
from perception.types import MODALITIES, Boxes3D, MapFilling, Modality
from tests.car_frames import SIZE_PX, write_car_frames
from tests.data.samples.images.conftest import SMALL
from tests.detection.bright_cells import bright_cells
from tests.faults import fault

Make = Callable[..., LabelledImages]


def entries(store: ArrayStore) -> int:
    return len(list(store.folder.iterdir()))


@pytest.mark.parametrize("modality", ["dm", "rm"])
@pytest.mark.parametrize("filling", ["default", "sparse"])
def test_a_map_is_what_a_detector_is_shown(
    make_images: Make, modality: Modality, filling: MapFilling
):
    frames = make_images(modality, filling=filling)
    dense = fill_maps(project_frame(frames.drives[0][1]), filling)
    image = map_image(dense, modality)
    expected = prepare_image(image, modality, place(PixelRectangle.whole(image), SMALL))
    np.testing.assert_array_equal(frames.image(1), expected)
    assert frames.image(1).shape == (96, 320, 1)
    assert frames.size_px(1) == SIZE_PX


def test_an_image_is_red_green_blue_in_its_own_aspect(make_images: Make):
    image = make_images("rgb").image(2)
    assert image.shape == (96, 320, 3)
    assert image[10, 10].tolist() == [230, 0, 0]
    assert image[10, 300].tolist() == [0, 0, 230]
    assert image[10, 313].tolist() == [114, 114, 114]


def test_an_image_is_stretched_as_the_thesis_does(make_images: Make):
    image = make_images("rgb", fit="stretch").image(2)
    assert image[10, 319].tolist() == [0, 0, 230]


def test_both_maps_are_kept_at_once_and_read_again(
    make_images: Make, make_frames: Callable[..., Path], store: ArrayStore, monkeypatch
):
    root = make_frames()
    depth = np.array(make_images("dm", root).image(0))

    def never(*args: object) -> None:
        raise AssertionError("it was cached already")

    monkeypatch.setattr(labelled_images, "make_images", never)
    reflectance = make_images("rm", root, class_names=("Van",)).image(0)
    assert (reflectance > 0).sum() == pytest.approx((depth > 0).sum(), rel=0.2)
    np.testing.assert_array_equal(make_images("dm", root).image(0), depth)
    assert entries(store) == 1


@pytest.mark.parametrize(
    ("modality", "changes"),
    [
        ("dm", {"size": InputSize(64, 224)}),
        ("dm", {"filling": "nearest"}),
        ("dm", {"jpeg_quality": 75}),
        ("rgb", {"jpeg_quality": 75}),
    ],
)
def test_other_settings_make_other_entries(
    make_images: Make,
    make_frames: Callable[..., Path],
    store: ArrayStore,
    modality: Modality,
    changes: dict[str, object],
):
    root = make_frames(frames=1)
    make_images(modality, root).image(0)
    make_images(modality, root, **changes).image(0)
    assert entries(store) == 2


def test_images_do_not_depend_on_how_maps_are_filled(
    make_images: Make, make_frames: Callable[..., Path], store: ArrayStore
):
    root = make_frames(frames=1)
    make_images("rgb", root).image(0)
    make_images("rgb", root, filling="nearest").image(0)
    assert entries(store) == 1


@pytest.mark.parametrize(
    ("modality", "file"),
    [
        ("rgb", "image_2/000000.png"),
        ("dm", "velodyne/000000.bin"),
        ("dm", "calib/000000.txt"),
    ],
)
def test_a_file_that_changed_is_read_again(
    make_images: Make,
    make_frames: Callable[..., Path],
    store: ArrayStore,
    modality: Modality,
    file: str,
):
    root = make_frames(frames=1)
    make_images(modality, root).image(0)
    path = root / "training" / file
    os.utime(path, ns=(0, path.stat().st_mtime_ns + 10**9))
    make_images(modality, root).image(0)
    assert entries(store) == 2


def test_the_cache_stays_within_its_budget(make_frames: Callable[..., Path], tmp_path: Path):
    budget_bytes = 200_000  # three entries of two maps of 30 kB and their headers
    store = ArrayStore(tmp_path / "small", budget_bytes)
    frames = LabelledImages([open_drive(make_frames())], ImageConfig("dm", size=SMALL), store)
    images = [np.array(frames.image(number)) for number in range(5)]
    kept_bytes = sum(path.stat().st_size for path in store.folder.rglob("*.npy"))
    assert 0 < kept_bytes <= budget_bytes
    for number, image in enumerate(images):  # what went is made again
        np.testing.assert_array_equal(frames.image(number), image)


def test_jpeg_leaves_its_traces_as_opencv_writes_them(make_images: Make):
    frames = make_images("rm", jpeg_quality=75, size=InputSize(190, 620))
    dense = fill_maps(project_frame(frames.drives[0][0]))
    _, data = cv2.imencode(".jpg", map_image(dense, "rm"), [cv2.IMWRITE_JPEG_QUALITY, 75])
    expected = cv2.imdecode(data, cv2.IMREAD_GRAYSCALE)
    np.testing.assert_array_equal(frames.image(0)[..., 0], expected)
    assert (expected != map_image(dense, "rm")[..., 0]).any()


@pytest.mark.parametrize("modality", MODALITIES)
def test_a_network_runs_on_the_images_that_it_was_trained_on(
    make_images: Make, tmp_path: Path, modality: Modality
):
    model = tmp_path / "thesis.onnx"
    model.write_bytes(bright_cells(modality, size=(96, 320), filling="thesis", jpeg_quality="75"))
    detector = ModalityDetector(model)
    frames = make_images(modality, filling="thesis", jpeg_quality=75)
    image = modality_image(frames.drives[0][0], modality, detector.filling)
    trained_on = frames.image(0).transpose(2, 0, 1)
    np.testing.assert_array_equal(detector.preprocess(image)[0], trained_on)


def test_jpeg_keeps_colours_in_their_order(make_images: Make):
    red, blue = make_images("rgb", jpeg_quality=90).image(0)[10, [10, 300]].astype(int)
    np.testing.assert_allclose(red, [250, 0, 0], atol=6)
    np.testing.assert_allclose(blue, [0, 0, 250], atol=6)


def test_maps_need_no_image_and_images_need_one(tmp_path: Path, store: ArrayStore):
    drive = open_drive(write_car_frames(tmp_path / "lidar", 1))
    assert LabelledImages([drive], ImageConfig("rm"), store).image(0).any()
    with fault(ImageError, "000000.bin", "a camera image", "none"):
        LabelledImages([drive], ImageConfig("rgb"), store).image(0)


def test_a_scan_that_cannot_be_read_is_named(make_images: Make, make_frames: Callable[..., Path]):
    root = make_frames(frames=2)
    (root / "training/velodyne/000001.bin").write_bytes(b"short")
    frames = make_images("dm", root)
    assert frames.image(0).any()
    with fault(ScanError, "000001.bin", "16 bytes a point"):
        frames.image(1)


def test_an_image_that_cannot_be_read_is_named(make_images: Make, make_frames: Callable[..., Path]):
    root = make_frames(frames=1)
    (root / "training/image_2/000000.png").write_bytes(b"no image")
    with fault(ImageError, "000000.png", "a whole PNG or JPEG image"):
        make_images("rgb", root).image(0)


def test_labels_that_cannot_be_read_are_named(make_images: Make, make_frames: Callable[..., Path]):
    root = make_frames(frames=1)
    (root / "training/label_2/000000.txt").write_text("Car 0 0 0 nan 1 2 3 1 1 1 0 0 9 0\n")
    with fault(LabelError, "000000.txt row 1", "finite numbers", "nan"):
        make_images("dm", root).labels(0)


def test_an_empty_label_file_is_a_frame_without_objects(
    make_images: Make, make_frames: Callable[..., Path]
):
    root = make_frames(frames=1)
    (root / "training/label_2/000000.txt").write_text("")
    frames = make_images("dm", root)
    assert (len(frames.labels(0)), len(frames.targets(0))) == (0, 0)


def test_boxes_without_an_area_are_left_out_and_logged_once(
    make_images: Make, make_frames: Callable[..., Path], caplog
):
    root = make_frames(frames=1)
    path = root / "training/label_2/000000.txt"
    row = "Car 0 0 0 {} 50 {} 90 1.5 1.7 4 0 1.7 20 0\n"
    path.write_text(row.format(100, 160) + row.format(100, 100) + row.format(700, 800))
    frames = make_images("dm", root)
    with caplog.at_level(logging.WARNING):
        found = frames.targets(0), frames.targets(0)
    assert [len(labels) for labels in found] == [1, 1]
    assert caplog.messages == [
        f"{root}/training frame 0: left out 2 labels without an area within the image"
    ]


@pytest.mark.parametrize(
    ("config", "where", "found"),
    [
        ({"modality": "ir"}, "modality", "ir"),
        ({"class_names": ()}, "class names", "none"),
        ({"class_names": ("Car", "car")}, "class names", "Car, car"),
        ({"jpeg_quality": 0}, "JPEG quality", "0"),
    ],
)
def test_inputs_that_cannot_be_are_refused(config: dict[str, object], where: str, found: str):
    with fault(UsageError, where, found=found):
        ImageConfig(**{"modality": "dm", **config})


def test_real_frames_in_all_views(kitti_root: Path, store: ArrayStore):
    drive = open_drive(kitti_root / "object")
    for modality, share in (("rgb", 1.0), ("dm", 0.5), ("rm", 0.5)):
        frames = LabelledImages([drive], ImageConfig(modality), store)
        image, labels = frames.image(3), frames.targets(3)
        assert image.shape[:2] == (192, 640)
        assert (image.max(axis=2) > 0).mean() > 0.9 * share
        width, height = frames.size_px(3)
        assert 1220 < width < 1250
        assert 368 < height < 378
        assert (labels.boxes_px >= 0).all()
        assert (labels.boxes_px <= [640, 192, 640, 192]).all()


def test_proposals_are_labels_of_the_image(tmp_path: Path, store: ArrayStore):
    [folder] = write_drives(tmp_path / "drive", SynthConfig("tracking", 1, sensor=VLP_16, seed=4))
    drive = open_drive(folder)
    kinds = {1: ("Car", 0.9), 2: ("Bus", 0.9), 3: ("Car", 0.2), 4: ("Car", 0.9)}
    places_m = {
        1: (10.0, 3.0),
        2: (20.0, -4.0),
        3: (12.0, -3.0),
        4: (-10.0, 0.0),
    }  # the last is behind
    proposals = [
        Proposal(
            number, kind, confidence, False, np.zeros(1, np.int64),
            Boxes3D(np.array([[*places_m[number], -1.7]]), np.array([[4.0, 1.8, 1.5]]), np.zeros(1)),
            np.full(1, 9), 0,
        )
        for number, (kind, confidence) in kinds.items()
    ]  # fmt: skip
    ProposalFile(proposals, {0: np.eye(4)}, {0: drive.frame_names[0]}).write(tmp_path)
    images = LabelledImages(
        [drive], ImageConfig("rgb", ("Car", "Van")), store, {drive.name: ProposedLabels(tmp_path)}
    )
    found = images.labels(0)
    assert images.label_types() == {"Car": 2, "Bus": 1, "DontCare": 1}
    assert found.types.tolist() == ["Car"]
    calibration, size_px = drive.frame_calibration(0, drive.image(0)), images.size_px(0)
    expected_px = box_outlines_px(calibration.image_P_velo, proposals[0].boxes_world, size_px)
    np.testing.assert_allclose(found.boxes_px, expected_px)
    assert len(found.dont_care_px) == 2  # of another class, and unsure
    assert images.targets(0).is_ignored.tolist().count(True) >= 2
