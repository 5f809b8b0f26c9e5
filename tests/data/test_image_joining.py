"""Images are joined to scans by name; by the nearest time where the times contradict the names."""

from pathlib import Path

import numpy as np
import pytest

from data.open_drive import open_drive
from tests.data.conftest import write_image


def write_times(folder: Path, stamps_s: list[float]) -> None:
    rows = [f"2011-09-26 13:04:{32 + stamp_s:012.9f}" for stamp_s in stamps_s]
    (folder / "timestamps.txt").write_text("\n".join(rows) + "\n")


def image_numbers(drive) -> list[int | None]:
    return [None if path is None else int(path.stem) for path in drive.images.paths]


@pytest.fixture
def camera(raw_drive: Path) -> Path:
    return raw_drive / "image_02"


def test_synchronised_images_are_joined_by_name(raw_drive, camera):
    write_times(camera, [0.01 + 0.1 * index for index in range(6)])
    drive = open_drive(raw_drive)
    assert image_numbers(drive) == [0, 1, 2, 3, 4, 5]
    assert drive.notes == ()


def test_a_camera_of_another_rate_is_joined_by_time(raw_drive, camera):
    for index in range(6, 14):
        write_image(camera / f"data/{index:010d}.png")
    write_times(camera, [index / 30 for index in range(14)])
    drive = open_drive(raw_drive)
    assert image_numbers(drive) == [0, 3, 6, 9, 12, None]
    assert drive[4].image is not None
    assert drive[5].image is None
    (note,) = drive.notes
    assert "14 images are joined to the scans by their times" in note
    assert note.endswith("5 of 6 scans have one")
    assert image_numbers(drive.select([5, 1])) == [None, 3]


def test_an_image_that_was_dropped_shifts_no_other(raw_drive, camera):
    (camera / "data/0000000005.png").unlink()
    write_times(camera, [0.0, 0.1, 0.3, 0.4, 0.5])  # the third was never taken
    assert image_numbers(open_drive(raw_drive)) == [0, 1, None, 2, 3, 4]


def test_a_missing_file_is_no_other_number(raw_drive, camera):
    write_times(camera, [0.1 * index for index in range(6)])
    (camera / "data/0000000002.png").unlink()
    assert image_numbers(open_drive(raw_drive)) == [0, 1, 2, 3, 4, 5]


def test_clocks_of_other_epochs_leave_the_names(raw_drive, camera):
    write_times(camera, [20 + 0.1 * index for index in range(6)])
    assert image_numbers(open_drive(raw_drive)) == [0, 1, 2, 3, 4, 5]


def test_files_named_by_unix_times_are_joined_by_time(tmp_path):
    folder = tmp_path / "drive"
    data = folder / "velodyne_points/data"
    data.mkdir(parents=True)
    points = np.full((20, 4), 0.5, np.float32)
    for index in range(3):
        stamp_ns = 1_600_000_000_000_000_000 + index * 100_000_000
        points.tofile(data / f"{stamp_ns}.bin")
        if index != 1:
            write_image(folder / f"image_02/data/{stamp_ns + 7_000_000}.png")
    drive = open_drive(folder)
    assert [drive.stamp_s(index) for index in range(3)] == pytest.approx([0, 0.1, 0.2])
    assert [None if path is None else path.stem[-9:] for path in drive.images.paths] == [
        "007000000",
        None,
        "207000000",
    ]


def test_names_beyond_any_time_are_no_times(tmp_path):
    data = tmp_path / "velodyne_points/data"
    data.mkdir(parents=True)
    np.full((20, 4), 0.5, np.float32).tofile(data / f"{'9' * 19}.bin")
    assert open_drive(tmp_path).stamp_s(0) == 0
