"""`trifuse check`: the table, and exit code 2 where there is a fault."""

import numpy as np
import pytest

from perception.cli.main import main
from perception.errors import DriveError
from tests.faults import command, fault


@pytest.fixture
def scans_only(tmp_path):
    """Return a raw drive of four scans of a flat road."""
    folder = tmp_path / "2011_09_26_drive_0042_sync/velodyne_points/data"
    folder.mkdir(parents=True)
    radius_m, azimuth = np.meshgrid(np.geomspace(3, 40, 40), np.linspace(-np.pi, np.pi, 90))
    x, y = radius_m * np.cos(azimuth), radius_m * np.sin(azimuth)
    points = np.stack([x, y, np.full_like(x, -1.73), 0 * x], axis=-1, dtype=np.float32)
    for index in range(4):
        points.tofile(folder / f"{index:010d}.bin")
    return tmp_path / "2011_09_26_drive_0042_sync"


def test_a_drive_without_faults_passes(scans_only, capsys):
    assert main(["check", str(scans_only)]) == 0
    table = capsys.readouterr().out
    assert (
        "2011_09_26_drive_0042_sync: 4 frames, 0.3 s, HDL-64E (64 beams, 10 Hz) with 3,600 points"
        in table
    )
    assert "note  no images" in table
    assert "no faults" in table


def test_a_fault_is_in_the_table_and_in_the_exit_code(scans_only, capsys):
    (scans_only / "velodyne_points/data/0000000001.bin").write_bytes(b"")
    with fault(DriveError, where=str(scans_only), expected="a drive without faults", found="1"):
        command("check", scans_only)
    table = capsys.readouterr().out
    assert "scans missing or damaged" in table
    assert "0000000001.bin: expected at least one return, found an empty scan" in table


def test_another_sensor_height_is_a_fault(scans_only, capsys, tmp_path):
    sensor = tmp_path / "low.json"
    sensor.write_text(
        '{"name": "low", "elevations_rad": [0.1, -0.4], "azimuth_step_rad": 0.003, "rate_hz": 10,'
        ' "height_m": 0.6, "min_range_m": 0.5, "max_range_m": 100, "range_noise_m": 0.02}'
    )
    assert main(["check", str(scans_only), "--sensor", str(sensor)]) == 2
    assert "expected the ground 0.60 m below the LiDAR, as low says" in capsys.readouterr().out


def test_every_drive_of_a_folder_is_checked(scans_only, capsys):
    scans_only.rename(scans_only.with_name("2011_09_26_drive_0043_sync"))
    empty = scans_only / "velodyne_points/data"
    empty.mkdir(parents=True)
    assert main(["check", str(scans_only.parent)]) == 2
    table = capsys.readouterr().out
    assert "drive_0042_sync: cannot be opened" in table
    assert "drive_0043_sync: 4 frames" in table


def test_a_folder_without_a_drive_is_an_error(tmp_path):
    with fault(DriveError, where=str(tmp_path), expected="a KITTI raw drive"):
        command("check", tmp_path)


@pytest.mark.parametrize("layout", ["tracking", "object"])
def test_official_drives_are_clean(kitti_root, layout, capsys):
    assert main(["check", str(kitti_root / layout)]) == 0
    table = capsys.readouterr().out
    assert "no faults" in table
    assert "note" not in table
