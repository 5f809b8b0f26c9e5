"""The study of intervals on a short street: shares of poses, moving objects and boxes, as a table and as JSON."""

import json

import cv2

from benchmarks.studies.report import StreetFlags
from benchmarks.studies.uncertainty import UncertaintyConfig, uncertainty


def test_uncertainty(tmp_path, capsys):
    out = tmp_path / "uncertainty.png"
    config = UncertaintyConfig(("VLP-16",), ("town",), start_every=2, images=False)
    uncertainty(streets=StreetFlags(4), config=config, out=out)
    assert cv2.imread(str(out)).std() > 5
    results = json.loads(out.with_suffix(".json").read_text())["results"]
    poses = results["poses"]
    assert list(poses) == [
        f"VLP-16: {ins}, {span}" for ins in ("INS", "no INS") for span in ("1 scan", "to 1 s")
    ]
    # Two starts, at the scans 0 and 2: two poses a scan later, and two more of the first start.
    assert [row["number"] for row in poses.values()] == [2, 2, 2, 2]
    assert all(0 <= row[part] <= 1 for row in poses.values() for part in ("position", "rotation"))
    assert all(0 < row[part] < 5 for row in poses.values() for part in ("x", "roll", "yaw"))
    objects = results["objects"]
    assert list(objects) == [
        f"VLP-16: {name}" for name in ("moving objects", "confirmed boxes", "new boxes")
    ]
    assert objects["VLP-16: new boxes"]["number"] > 0
    assert "Boxes of confirmed objects" in capsys.readouterr().out


def test_poses_are_estimated_at_each_frame_rate(tmp_path):
    out = tmp_path / "uncertainty.png"
    config = UncertaintyConfig(("VLP-16",), ("town",), (5, 10), start_every=4, images=False)
    uncertainty(streets=StreetFlags(5), config=config, out=out)
    poses = json.loads(out.with_suffix(".json").read_text())["results"]["poses"]
    # Scans 0, 2 and 4 at 5 Hz, all five at 10 Hz; the start at the last one has none after it.
    numbers = {name: row["number"] for name, row in poses.items() if "no INS" not in name}
    assert numbers == {
        "VLP-16: INS, 5 Hz, 1 scan": 1,
        "VLP-16: INS, 5 Hz, to 1 s": 1,
        "VLP-16: INS, 10 Hz, 1 scan": 1,
        "VLP-16: INS, 10 Hz, to 1 s": 3,
    }
