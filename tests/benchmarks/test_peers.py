"""Peers by stand-ins of their packages: what each is given, and what is made of its result."""

import sys
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest

from benchmarks.ground import line_fit, patchwork
from benchmarks.motion import dufomap
from benchmarks.registration import kiss_icp_odometry
from perception.errors import MissingDependencyError
from perception.sensor import VLP_16, LidarModel

POINTS = np.float32([[5, 0, -1.7, 0.1], [5, 1, 0.5, 0.2], [6, 0, -1.7, 0.3]])


def module(name, **members):
    made = ModuleType(name)
    made.__dict__.update(members)
    return made


@pytest.mark.parametrize(
    ("package", "make"),
    [
        ("linefit", lambda: line_fit(VLP_16)),
        ("pypatchworkpp", lambda: patchwork(VLP_16)),
        ("dufomap", dufomap),
        ("kiss_icp.config", kiss_icp_odometry),
    ],
)
def test_a_package_that_is_missing_is_named_with_its_extra(monkeypatch, package, make):
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(MissingDependencyError) as caught:
        make()
    assert package.partition(".")[0].replace("_", "-") in caught.value.expected
    assert "[bench]" in caught.value.advice


def test_line_fits_are_given_the_points_at_the_height_of_kittis_sensor(monkeypatch):
    given = []

    class GroundSeg:
        def run(self, points):
            given.append(points)
            return [1, 0, 1]

    monkeypatch.setitem(sys.modules, "linefit", module("linefit", ground_seg=GroundSeg))
    higher = LidarModel(**{**vars(VLP_16), "height_m": 2.73})
    assert line_fit(higher)(POINTS).tolist() == [True, False, True]
    assert given[0] == pytest.approx(POINTS[:, :3] + [0, 0, 1.0])


def test_indices_of_patchwork_become_a_mask(monkeypatch):
    class Estimator:
        def __init__(self, parameters):
            assert parameters.sensor_height == VLP_16.height_m

        def estimateGround(self, points):
            assert points is POINTS

        def getGroundIndices(self):
            return np.array([[0], [2]])

    package = module("pypatchworkpp", Parameters=SimpleNamespace, patchworkpp=Estimator)
    monkeypatch.setitem(sys.modules, "pypatchworkpp", package)
    assert patchwork(VLP_16)(POINTS).tolist() == [True, False, True]


def test_dufomap_maps_a_scan_before_it_classifies_its_points(monkeypatch):
    calls, pose = [], np.eye(4)

    class Map:
        def __init__(self, *parameters, num_threads):
            assert (parameters, num_threads) == ((0.1, 0.2, 1), 1)

        def run(self, points, world_SE3_velo, *, cloud_transform):
            calls.append(("run", points.shape, cloud_transform))

        def segment(self, points, world_SE3_velo, *, cloud_transform):
            calls.append(("segment", points.shape, cloud_transform))
            return np.array([[0], [1], [0]])

    monkeypatch.setitem(sys.modules, "dufomap", module("dufomap", dufomap=Map))
    assert dufomap()(POINTS, pose).tolist() == [False, True, False]
    assert calls == [("run", (3, 3), True), ("segment", (3, 3), True)]


def test_kiss_icp_returns_the_pose_after_each_scan(monkeypatch):
    class Odometry:
        def __init__(self, config):
            assert not config.data.deskew and config.registration.max_num_threads == 1
            self.last_pose = np.eye(4)

        def register_frame(self, points, stamps):
            assert points.shape == (3, 3) and len(stamps) == 0
            self.last_pose[0, 3] += 1.0

    def load_config(path):
        assert path is None
        return SimpleNamespace(data=SimpleNamespace(), registration=SimpleNamespace())

    for name, members in (
        ("kiss_icp", {}),
        ("kiss_icp.config", {"load_config": load_config}),
        ("kiss_icp.kiss_icp", {"KissICP": Odometry}),
    ):
        monkeypatch.setitem(sys.modules, name, module(name, **members))
    odometry = kiss_icp_odometry()
    assert [odometry(POINTS)[0, 3], odometry(POINTS)[0, 3]] == [1.0, 2.0]
