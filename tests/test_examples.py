"""The examples of the documents are run."""

import importlib.util
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from data.messages.definitions import encoded, message, typestore
from data.messages.geometry import header
from data.open_drive import open_drive
from perception.detection.onnx_model import shipped_model
from perception.sensor import HDL_64E

EXAMPLES = Path(__file__).parents[1] / "docs" / "examples"


def load(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def cloud_message(points: np.ndarray, stamp_s: float) -> bytes:
    """Return a cloud as a driver of a LiDAR sends it: intensity 0 to 255, then the beam."""
    record = np.dtype([("xyz", "<f4", 3), ("intensity", "<f4"), ("ring", "<u2")])
    rows = np.zeros(len(points), record)
    rows["xyz"], rows["intensity"] = points[:, :3], np.round(255 * points[:, 3])
    offsets = {"x": (0, 7), "y": (4, 7), "z": (8, 7), "intensity": (12, 7), "ring": (16, 4)}
    fields = [
        message("sensor_msgs/PointField", name=name, offset=offset, datatype=kind, count=1)
        for name, (offset, kind) in offsets.items()
    ]
    cloud = message(
        "sensor_msgs/PointCloud2",
        header=header(stamp_s, "velodyne"),
        height=1,
        width=len(rows),
        fields=fields,
        is_bigendian=False,
        point_step=record.itemsize,
        row_step=rows.nbytes,
        data=rows.view(np.uint8),
        is_dense=True,
    )
    return encoded(cloud)


def test_they_are_short():
    lines = {path.stem: len(path.read_text().splitlines()) for path in EXAMPLES.glob("*.py")}
    assert lines.keys() == {"one_frame", "robot_stream", "own_detector", "ros2_node"}
    assert lines.pop("ros2_node") < 85
    assert max(lines.values()) <= 40


def test_one_frame(street, capsys):
    scan = next(iter(sorted(street.glob("velodyne_points/data/*.bin"))))
    load("one_frame").main(str(scan))
    printed = capsys.readouterr().out.splitlines()
    counts = {line.split(":")[0]: int(line.split()[1]) for line in printed[:4]}
    assert sum(counts.values()) == scan.stat().st_size // 16
    assert counts["ground"] > 1000
    assert float(printed[4].split()[4]) == pytest.approx(1.73, abs=0.15)


def test_robot_stream(street, capsys):
    opened = open_drive(street, images=False)
    load("robot_stream").drive_by(opened, opened.sensor)
    printed = capsys.readouterr().out.splitlines()
    dropped = int(printed[-1].split()[-3])
    assert len(printed) + dropped == 4
    assert all("m free, moving at" in line for line in printed)


def test_own_detector(street, capsys):
    load("own_detector").main(shipped_model("rgb_yolox"), street)
    printed = capsys.readouterr().out.splitlines()
    names = [line for line in printed if not line.startswith(" ")]
    assert names == ["000000", "000001", "000002", "000003"]
    for line in printed:
        if line.startswith(" "):
            number, name, score, distance, _ = line.split()
            assert int(number) >= -1
            assert name in {"Car", "Van", "Truck", "Pedestrian", "Cyclist"}
            assert 0.5 <= float(score) <= 1
            assert float(distance) > 0 or distance == "nan"


def test_ros2_node(street):
    node, store, opened = load("ros2_node"), typestore(), open_drive(street, images=False)
    perception = node.Perception(HDL_64E)
    kinds = ("sensor_msgs/msg/PointCloud2", "visualization_msgs/msg/MarkerArray",
             "nav_msgs/msg/Odometry", "tf2_msgs/msg/TFMessage")  # fmt: skip
    for index, frame in enumerate(opened):
        stamp_s = 1_700_000_000 + 0.1 * index
        found = perception.on_cloud(cloud_message(frame.points_velo, stamp_s))
        read = [store.deserialize_cdr(data, kind) for data, kind in zip(found, kinds, strict=True)]
    cloud, boxes, odometry, transforms = read
    assert cloud.width == len(frame.points_velo)
    assert cloud.header.stamp.sec == 1_700_000_000
    assert boxes.markers[0].action == 3  # the boxes of the last frame are deleted
    steps = [opened.world_SE3_velo(index)[:3, 3] for index in (2, 3)]
    speed_m_s = np.linalg.norm(steps[1] - steps[0]) / 0.1
    assert odometry.twist.twist.linear.x == pytest.approx(speed_m_s, abs=0.2)
    assert transforms.transforms[0].child_frame_id == "lidar"
    assert len(node.OUTPUTS) == len(found)


def test_a_cloud_keeps_its_points(street):
    frame = open_drive(street, images=False)[0]
    read = load("ros2_node").frame_of(0, cloud_message(frame.points_velo, frame.stamp_s))
    assert (read.points_velo[:, :3] == frame.points_velo[:, :3]).all()
    assert read.points_velo[:, 3] == pytest.approx(frame.points_velo[:, 3], abs=0.002)
    assert read.stamp_s == pytest.approx(frame.stamp_s, abs=1e-6)
