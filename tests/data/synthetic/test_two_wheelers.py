"""Two-wheelers have the sizes of real ones; without riders they have boxes, but no labels of KITTI's."""

import numpy as np
import pytest

from data.labelled_objects import box_owners
from data.synthetic import actors, lidar, meshes, two_wheelers
from data.synthetic.labelling import label_around
from data.synthetic.materials import SemanticClass, palette
from data.synthetic.road import Road, RoadShape
from data.synthetic.roadside import Plot
from data.synthetic.street import Part, StaticBox
from data.synthetic.verge import Verge
from perception.geometry import se3
from perception.sensor import HDL_64E


@pytest.mark.parametrize(
    ("build", "length_m", "width_m", "height_m"),
    [
        (two_wheelers.bicycle, 1.75, 0.56, 1.03),
        (two_wheelers.motorcycle, 2.05, 0.76, 1.24),
        (two_wheelers.scooter, 1.75, 0.70, 1.27),
    ],
)
def test_two_wheelers_stand_on_the_ground_and_measure_what_real_ones_do(
    build, length_m, width_m, height_m
):
    vertices_m = build().vertices_m
    size_m = np.ptp(vertices_m, axis=0)
    assert size_m == pytest.approx([length_m, width_m, height_m], abs=0.06)
    assert vertices_m[:, 2].min() == pytest.approx(0.0, abs=0.01)


def verge(shape: RoadShape, seed: int = 0) -> Verge:
    return Verge(Road(shape), 1, np.random.default_rng(seed), [], [], lambda *_: True)


@pytest.mark.parametrize("amount", ["bicycles", "motorcycles"])
def test_rows_of_two_wheelers_stand_behind_the_pavement(amount):
    shape = RoadShape(curvature_1_m=0.0, pavement_m=4.0)
    for seed in range(8):
        parts = getattr(verge(shape, seed), amount)(30.0)
        assert len(parts) <= 18
        for part in parts:
            out_m = part.mesh.vertices_m[:, 1]
            assert shape.half_width_m + 1.4 < out_m.min()
            assert out_m.max() < shape.outer_m + 0.5


def test_a_parked_motorcycle_is_no_labelled_object(flat_world):
    pose = se3.from_euler(0, 0, 1.2, np.array([8.0, 3.0, 0.0]))
    part = Part(
        meshes.moved(two_wheelers.motorcycle(), pose), palette(), SemanticClass.OTHER_OBJECT
    )
    world = flat_world([part])
    scan = lidar.scan(world, HDL_64E, 0.0, np.random.default_rng(0))
    is_near = np.linalg.norm(scan.points_velo[:, :2] - (8, 3), axis=1) < 1.2
    above = is_near & (scan.points_velo[:, 2] > -1.5)
    assert above.sum() > 80
    assert (scan.truth.instances[above] == 0).all()
    assert (scan.truth.classes[above] == SemanticClass.OTHER_OBJECT).all()
    assert len(world.actors) == 0


@pytest.mark.parametrize(
    ("amount", "category"), [("bicycles", "Bicycle"), ("motorcycles", "Motorcycle")]
)
def test_boxes_of_parked_two_wheelers_hold_their_returns_and_no_more(flat_world, amount, category):
    parts = getattr(verge(RoadShape(curvature_1_m=0.0, kerb_m=0.0, bank=0.0, crown=0.0)), amount)(
        4.0
    )
    world = flat_world(parts)
    velo = lidar.velo_poses(world, HDL_64E, np.zeros(1))[0]
    scan = lidar.scan(world, HDL_64E, 0.0, np.random.default_rng(0))
    assert len(label_around(world, velo, 0.0)) == 0
    labels = label_around(world, velo, 0.0, by_category=True)
    boxed = [part for part in parts if part.box is not None]
    assert len(boxed) >= 1
    assert labels.types.tolist() == [category] * len(boxed)
    assert len(set(labels.track_ids.tolist())) == len(boxed)
    boxes = labels.boxes_velo
    for row, part in enumerate(boxed):
        low, high = np.sort(part.mesh.vertices_m[:, 2])[[0, -1]] - velo[2, 3]
        assert boxes.size_m[row] == pytest.approx(np.array(part.box.size_m))
        assert boxes.bottom_m[row, 2] == pytest.approx(low, abs=1e-5)
        assert boxes.size_m[row, 2] == pytest.approx(high - low, abs=1e-5)
    owners = box_owners(labels.boxes_velo, scan.points_velo)
    is_object = scan.truth.classes == SemanticClass.OTHER_OBJECT
    assert is_object.sum() > 100
    assert (owners[is_object] >= 0).mean() > 0.98


def test_a_box_around_a_turned_object_has_its_size_and_place():
    pose = se3.from_euler(0, 0, 0.7, np.array([8.0, 3.0, 0.5]))
    mesh = meshes.moved(meshes.box((0.0, -0.5, 0.0), (3.0, 0.5, 1.2), 0), pose)
    box = StaticBox.around("Bicycle", mesh, pose)
    assert box.size_m == pytest.approx((3.0, 1.0, 1.2), abs=1e-5)
    middle = (8.0 + 1.5 * np.cos(0.7), 3.0 + 1.5 * np.sin(0.7), 0.5)
    assert box.world_SE3_box[:3, 3] == pytest.approx(middle, abs=1e-5)


def test_riders_of_motorcycles_are_cyclists_of_kitti_and_fill_their_boxes():
    bodies = actors.draw_motorcyclists(np.random.default_rng(0), 4)
    for body in bodies:
        assert (body.kind, body.category) == ("Cyclist", "Motorcycle")
        assert body.semantic == SemanticClass.MOTORCYCLIST
        low, high = body.poses[0].vertices_m.min(axis=0), body.poses[0].vertices_m.max(axis=0)
        assert high - low == pytest.approx(np.array(body.size_m), abs=1e-5)
        assert (low + high)[:2] / 2 == pytest.approx([0, 0], abs=0.05)
        assert 1.5 < body.size_m[2] < 1.85
        assert low[2] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("parking_m", [0.0, 2.1, 5.0])
def test_bays_keep_clear_of_lanes_and_pedestrians(parking_m):
    shape = RoadShape(curvature_1_m=0.0, parking_m=parking_m)
    bay, plants = Plot(20.0, 8.0, 1), [meshes.box((-0.5, -0.5, 0), (0.5, 0.5, 1), 0)]
    for seed in range(8):
        filled = Verge(
            Road(shape), 1, np.random.default_rng(seed), plants, plants, lambda *_: True
        ).bay(bay)
        assert len(filled) >= 2
        for part in filled:
            if np.ptp(part.mesh.vertices_m[:, 2]) > 2.5:
                continue  # a tree's crown reaches further
            along_m, out_m = part.mesh.vertices_m[:, 0], part.mesh.vertices_m[:, 1]
            assert 19.2 < along_m.min() < along_m.max() < 28.8
            assert shape.lanes_m - 0.15 < out_m.min()
            assert out_m.max() < shape.half_width_m + (1.1 if parking_m == 0 else 0.2)
