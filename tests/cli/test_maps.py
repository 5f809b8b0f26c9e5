"""`trifuse maps` writes pictures of one frame, or of all."""

import cv2
import pytest

from perception.cli.main import main
from perception.errors import UsageError
from tests.faults import command, fault


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    root = tmp_path_factory.mktemp("street")
    assert main(["synth", str(root), "--frames", "2", "--layout", "object"]) == 0
    return root


def test_one_frame_gets_both_maps_and_a_figure(drive, tmp_path, capsys):
    assert main(["maps", str(drive), "--frame", "1", "--out", str(tmp_path)]) == 0
    depth = cv2.imread(str(tmp_path / "depth" / "000001.png"), cv2.IMREAD_UNCHANGED)
    reflectance = cv2.imread(str(tmp_path / "reflectance" / "000001.png"), cv2.IMREAD_UNCHANGED)
    assert depth.ndim == 2
    assert depth.dtype == "uint8"
    assert depth.shape == reflectance.shape
    # Near is dark: the road at the car's bonnet against what is far.
    assert depth[-5:].mean() + 50 < depth[depth.shape[0] // 2 + 10].mean()
    assert (tmp_path / "maps_000001.png").is_file()
    assert "natural" in capsys.readouterr().out


def test_all_frames_get_both_maps(drive, tmp_path):
    assert main(["maps", str(drive), "--all", "true", "--out", str(tmp_path)]) == 0
    for kind in ("depth", "reflectance"):
        names = sorted(path.name for path in (tmp_path / kind).iterdir())
        assert names == ["000000.png", "000001.png"]
    assert not list(tmp_path.glob("maps_*.png"))


def test_a_frame_that_does_not_exist_is_an_error(drive, tmp_path):
    with fault(UsageError, where="--frame", expected="a frame of", found="9"):
        command("maps", drive, "--frame", "9", "--out", tmp_path)


def test_the_first_frames_can_be_chosen(drive, tmp_path, capsys):
    assert main(["maps", str(drive), "--all", "--frames", "1", "--out", str(tmp_path)]) == 0
    assert [path.name for path in (tmp_path / "depth").iterdir()] == ["000000.png"]
    assert capsys.readouterr().out.startswith("1 depth and reflectance maps")


@pytest.fixture(scope="module")
def two_cameras(tmp_path_factory):
    folder = tmp_path_factory.mktemp("two_cameras")
    write = ["synth", str(folder), "--frames", "2", "--layout", "folder"]
    assert main([*write, "--sensor", "VLP-16", "--cameras", "front,rear"]) == 0
    return str(folder / "0000")


@pytest.mark.parametrize("flags", [("--frame", "1"), ("--all",)])
def test_maps_are_of_every_camera_that_is_asked_for(two_cameras, tmp_path, flags):
    out, drive = tmp_path / "maps", two_cameras
    assert main(["maps", drive, "--camera", "rear,front", *flags, "--out", str(out)]) == 0
    assert main(["maps", drive, "--camera", "rear", *flags, "--out", str(tmp_path / "rear")]) == 0
    for kind in ("depth", "reflectance"):
        written = {path.name for path in (out / kind).iterdir()}
        frames = ("000001",) if "--frame" in flags else ("000000", "000001")
        assert written == {
            f"{frame}_{camera}.png" for frame in frames for camera in ("front", "rear")
        }
        rear = (out / kind / "000001_rear.png").read_bytes()
        assert rear == (tmp_path / "rear" / kind / "000001.png").read_bytes()
        assert rear != (out / kind / "000001_front.png").read_bytes()
