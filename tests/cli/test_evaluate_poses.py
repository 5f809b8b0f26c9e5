"""`trifuse evaluate poses` on a street whose poses are exact, and on drives that it cannot use."""

import json

import pytest

from perception.cli.main import main
from perception.errors import DriveError
from tests.faults import command, fault


def test_poses_of_a_street_are_near_the_exact_ones(street, tmp_path, capsys):
    path = tmp_path / "poses.json"
    assert main(["evaluate", "poses", str(street), "--frames", "4", "--json", str(path)]) == 0
    printed = capsys.readouterr().out
    assert "4 of " in printed
    assert "beside the exact poses" in printed
    results = json.loads(path.read_text())["results"]
    assert list(results["paths"]) == ["exact poses", "with INS", "its odometry", "scans alone"]
    for name in ("its odometry", "scans alone"):
        errors = results["runs"][name]
        assert errors["step_max_deg"] < 0.3, name
        assert errors["step_max_cm"] < 5, name
        assert len(results["paths"][name]["x_m"]) == 4
        assert results["paths"][name]["x_m"][0] == pytest.approx(
            results["paths"]["exact poses"]["x_m"][0]
        )


def test_a_drive_without_poses_is_one_sentence(tmp_path):
    from tests.data.folder.conftest import road_scan

    (tmp_path / "lidar").mkdir()
    for index in range(2):
        road_scan(index, columns=90).tofile(tmp_path / "lidar" / f"{index:06d}.bin")
    with fault(DriveError, str(tmp_path), "poses that follow each other", "without poses"):
        command("evaluate", "poses", str(tmp_path))
