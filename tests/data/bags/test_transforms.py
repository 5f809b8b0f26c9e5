"""Transforms along the frames of a robot."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from data.bags.transforms import TransformTree
from perception.errors import CalibrationError
from perception.geometry.se3 import from_euler, inverse

BASE_SE3_MAST = from_euler(0.1, 0, 0, np.array([1.0, 0, 1.5]))
MAST_SE3_LIDAR = from_euler(0, 0.2, 0, np.array([0, 0, 0.3]))
BASE_SE3_CAMERA = from_euler(0, 0, -0.5, np.array([2.0, 0.1, 1.0]))


def message(*edges: tuple[str, str, np.ndarray]) -> SimpleNamespace:
    from scipy.spatial.transform import Rotation

    def point(numbers: np.ndarray, names: str) -> SimpleNamespace:
        return SimpleNamespace(**dict(zip(names, numbers, strict=True)))

    return SimpleNamespace(
        transforms=[
            SimpleNamespace(
                header=SimpleNamespace(frame_id=parent),
                child_frame_id=child,
                transform=SimpleNamespace(
                    rotation=point(Rotation.from_matrix(pose[:3, :3]).as_quat(), "xyzw"),
                    translation=point(pose[:3, 3], "xyz"),
                ),
            )
            for parent, child, pose in edges
        ]
    )


@pytest.fixture
def tree() -> TransformTree:
    tree = TransformTree("drive.bag")
    tree.add(message(("/base_link", "/mast", BASE_SE3_MAST), ("mast", "lidar", MAST_SE3_LIDAR)))
    tree.add(message(("base_link", "camera", BASE_SE3_CAMERA)))
    return tree


def test_transforms_are_chained_up_and_down(tree: TransformTree) -> None:
    expected = inverse(BASE_SE3_CAMERA) @ BASE_SE3_MAST @ MAST_SE3_LIDAR
    assert np.allclose(tree.require("camera", "/lidar", "to see"), expected)
    assert np.allclose(tree.find("lidar", "camera"), inverse(expected))
    assert np.array_equal(tree.find("camera", "camera"), np.eye(4))


def test_the_first_transform_of_an_edge_holds(tree: TransformTree) -> None:
    tree.add(message(("mast", "lidar", np.eye(4))))
    assert np.allclose(tree.find("mast", "lidar"), MAST_SE3_LIDAR)


def test_a_missing_transform_is_named(tree: TransformTree) -> None:
    expected = (
        r"drive.bag: expected a transform from lidar to gps in /tf_static or /tf, to see, "
        r"found none between these among the frames base_link, camera, lidar, mast; record"
    )
    with pytest.raises(CalibrationError, match=expected):
        tree.require("gps", "lidar", "to see")
    with pytest.raises(CalibrationError, match="among the frames of no tf message"):
        TransformTree("drive.bag").require("gps", "lidar", "to see")


def test_what_is_no_rotation_is_left_out(tree: TransformTree) -> None:
    broken = message(("base_link", "gps", np.eye(4)))
    broken.transforms[0].transform.rotation.w = 0.0
    tree.add(broken)
    broken.transforms[0].transform.rotation.w = float("nan")
    tree.add(broken)
    assert tree.find("base_link", "gps") is None


def test_frames_in_a_circle_end() -> None:
    tree = TransformTree(str(Path("x.bag")))
    tree.add(message(("a", "b", np.eye(4)), ("b", "c", np.eye(4)), ("c", "a", np.eye(4))))
    assert tree.find("a", "nowhere") is None
