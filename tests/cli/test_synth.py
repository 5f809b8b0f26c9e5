"""`trifuse synth`."""

import pytest

from perception.cli.main import main
from perception.errors import UsageError
from tests.faults import command, fault


def test_a_drive_is_written_and_named(tmp_path, capsys):
    words = ["synth", str(tmp_path), "--frames", "1", "--sensor", "VLP-16", "--images", "false"]
    assert main([*words, "--ins_noise_m", "0.1"]) == 0
    named = capsys.readouterr().out.strip()
    assert named.endswith("_drive_0000_sync")
    assert (tmp_path / named / "velodyne_points" / "data" / "0000000000.bin").is_file()


def test_an_impossible_speed_is_an_error(tmp_path):
    with fault(UsageError, expected="ego_m_s above 0 up to 20", found="90"):
        command("synth", tmp_path, "--speed", "90")


def test_an_unknown_sensor_is_an_error(tmp_path):
    with fault(UsageError, where="HDL-128", expected="HDL-64E, HDL-32E, VLP-16"):
        command("synth", tmp_path, "--sensor", "HDL-128")


def test_drives_are_refused_or_replaced(tmp_path, capsys):
    words = ["synth", str(tmp_path), "--sensor", "VLP-16", "--no-images"]
    assert main([*words, "--frames", "2"]) == 0
    assert main([*words, "--frames", "1"]) == 2
    assert main([*words, "--frames", "1", "--speed", "90", "--overwrite"]) == 2
    assert len(list(tmp_path.rglob("*.bin"))) == 2
    assert main([*words, "--frames", "1", "--overwrite"]) == 0
    assert len(list(tmp_path.rglob("*.bin"))) == 1


@pytest.mark.parametrize(
    ("part", "found"), [("3", "3"), ("0/2", "0/2"), ("3/2", "3/2"), ("1/3", "1/3"), ("a/b", "a/b")]
)
def test_a_part_that_does_not_exist_is_an_error(tmp_path, part, found):
    with fault(UsageError, "--part", found=found):
        command("synth", tmp_path, "--drives", "2", "--part", part)
    assert not list(tmp_path.iterdir())
