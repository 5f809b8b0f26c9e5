"""Pictures and scenes of frames: right, kept, and made anew where anything changes."""

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from data.array_store import ArrayStore
from data.open_drive import open_drive
from data.samples.crops import labelled_frames
from data.samples.crops.labelled_frames import CropConfig, LabelledFrames
from perception.detection.config import ProposalConfig
from perception.errors import CalibrationError, DriveError
from tests.faults import fault


def entries(store: ArrayStore) -> int:
    return len(list(store.folder.iterdir()))


def touch(path: Path) -> None:
    stat = path.stat()
    os.utime(path, ns=(stat.st_atime_ns, stat.st_mtime_ns + 10**9))


def test_a_scene_holds_who_is_made_of_what(street: LabelledFrames):
    scene = street.scene(0)
    assert scene.label_types.tolist() == ["Car", "Van"]
    # The near faces: 14 - 4 / 2 and 20 - 5 / 2, and 0.27 from the LiDAR to the camera.
    np.testing.assert_allclose(scene.label_depths_m, [11.73, 17.23], atol=0.01)
    assert (scene.label_points > 100).all()
    assert scene.shares.shape == (len(scene.boxes_px), 2)
    np.testing.assert_allclose(np.sort(scene.shares.max(axis=1))[-2:], 1.0)
    assert scene.focal_px == 180.0


def test_an_image_holds_depth_height_and_reflectance(street: LabelledFrames):
    image = street.image(0)
    assert image.shape == (95, 310, 3)
    scene = street.scene(0)
    x1, y1, x2, y2 = scene.label_boxes_px[0].astype(int)
    on_car = image[(y1 + y2) // 2, (x1 + x2) // 2]
    assert int(on_car[2]) == pytest.approx(127, abs=2)


def test_all_is_cached_and_read_again(street: LabelledFrames, monkeypatch):
    scene, image = street.scene(1), np.array(street.image(1))

    def never(*args: object) -> None:
        raise AssertionError("it was cached already")

    monkeypatch.setattr(labelled_frames, "_scene", never)
    monkeypatch.setattr(labelled_frames, "_make_image", never)
    again = LabelledFrames(street.drives, street.config, street.store)
    np.testing.assert_array_equal(again.image(1), image)
    assert again.scene(1).focal_px == scene.focal_px
    np.testing.assert_array_equal(again.scene(1).shares, scene.shares)


@pytest.mark.parametrize(
    ("config", "images", "scenes"),
    [
        pytest.param(CropConfig(), 0, 0, id="nothing"),
        pytest.param(CropConfig("thesis"), 1, 1, id="method"),
        pytest.param(CropConfig(proposals=ProposalConfig(radius_m=0.4)), 0, 1, id="proposals"),
    ],
)
def test_other_settings_make_new_entries(
    street: LabelledFrames, config: CropConfig, images: int, scenes: int
):
    street.image(0), street.scene(0)
    before = entries(street.store)
    other = LabelledFrames(street.drives, config, street.store)
    other.image(0)
    assert entries(street.store) == before + images
    other.scene(0)
    assert entries(street.store) == before + images + scenes


@pytest.mark.parametrize("name", ["velodyne/000000.bin", "calib/000000.txt", "label_2/000000.txt"])
def test_other_files_make_new_entries(street: LabelledFrames, name: str):
    street.scene(0), street.scene(1)
    touch(street.drives[0].root / name)
    LabelledFrames(street.drives, street.config, street.store).scene(0)
    assert entries(street.store) == 3
    LabelledFrames(street.drives, street.config, street.store).scene(1)
    assert entries(street.store) == 3


def test_other_code_makes_new_entries(street: LabelledFrames, monkeypatch):
    street.scene(0)
    monkeypatch.setattr(labelled_frames, "code_fingerprint", lambda *sources: "another")
    LabelledFrames(street.drives, street.config, street.store).scene(0)
    assert entries(street.store) == 2


def test_frames_of_several_drives_are_numbered_through(
    make_street: Callable[..., Path], store: ArrayStore
):
    drives = [
        open_drive(make_street("first", frames=2)),
        open_drive(make_street("second", ["Car"])),
    ]
    frames = LabelledFrames(drives, CropConfig(), store)
    assert len(frames) == 5
    assert [frames.place(number)[0] for number in range(5)] == [drives[0]] * 2 + [drives[1]] * 3
    assert [len(frames.scene(number).label_types) for number in range(5)] == [2, 2, 1, 1, 1]


def test_a_drive_without_a_camera_is_refused(make_street: Callable[..., Path], store: ArrayStore):
    folder = make_street() / "training" / "calib"
    for path in folder.iterdir():
        path.unlink()
    folder.rmdir()
    frames = LabelledFrames([open_drive(folder.parent)], CropConfig(), store)
    with fault(CalibrationError, where=str(folder), found="none"):
        frames.scene(0)


def test_a_drive_without_labels_is_refused(make_street: Callable[..., Path], store: ArrayStore):
    folder = make_street() / "training" / "label_2"
    folder.rename(folder.with_name("elsewhere"))
    frames = LabelledFrames([open_drive(folder.parent)], CropConfig(), store)
    with fault(
        DriveError,
        str(folder.parent),
        "a drive with labelled boxes",
        "none",
        "name one with label files, such as a tracking sequence",
    ):
        frames.scene(0)
