"""Low street furniture is as large as people, returns light as its material does, and leaves the lanes free."""

import numpy as np
import pytest

from data.synthetic import clutter, furniture, lidar, low_furniture, meshes, world_kinds
from data.synthetic.clutter import ClutterConfig
from data.synthetic.materials import SemanticClass, Slot
from data.synthetic.road import Road, RoadShape
from data.synthetic.street import Part
from perception.geometry import se3
from perception.sensor import HDL_64E

# Limits of the width across the face, and of the height, of all that is drawn.
LIMITS = {
    low_furniture.keep_right_sign: (0.36, 0.70, 0.85, 6.05),
    low_furniture.beacon: (0.18, 0.85, 0.65, 1.45),
    low_furniture.bollard: (0.08, 0.50, 0.40, 1.55),
    low_furniture.meter: (0.15, 0.60, 0.65, 6.05),
    low_furniture.info_pillar: (0.25, 1.05, 0.95, 2.45),
    low_furniture.column: (0.09, 0.65, 2.1, 6.05),
    low_furniture.hydrant: (0.25, 0.70, 0.50, 1.15),
    low_furniture.litter_bin: (0.20, 0.90, 0.55, 1.60),
    low_furniture.sapling: (0.03, 2.20, 1.50, 5.00),
    low_furniture.shrub: (0.30, 6.50, 0.40, 2.60),
}


@pytest.mark.parametrize("build", LIMITS)
def test_low_furniture_keeps_its_size(build):
    narrow_m, wide_m, low_m, high_m = LIMITS[build]
    for seed in range(12):
        vertices_m = build(np.random.default_rng(seed)).vertices_m
        assert narrow_m < np.ptp(vertices_m[:, 1]) < wide_m
        assert low_m < vertices_m[:, 2].max() < high_m
        assert vertices_m[:, 2].min() < 0.06  # nothing floats


def test_every_kind_is_drawn():
    assert {build for build, _, _ in low_furniture.KINDS} == set(LIMITS)
    assert sum(share for _, share, _ in low_furniture.KINDS) == pytest.approx(1.0)


def test_the_face_of_a_keep_right_sign_is_brighter_than_its_back(flat_world):
    def returns(turn_rad):
        rng = np.random.default_rng(3)
        mesh, appearance = low_furniture.keep_right_sign(rng), low_furniture.low_palette(rng)
        appearance[Slot.SIGN, 3] = 0.95
        pose = se3.from_euler(0, 0, turn_rad, np.array([9.0, 0.0, 0.0]))
        world = flat_world([Part(meshes.moved(mesh, pose), appearance)])
        scan = lidar.scan(world, HDL_64E, 0.0, np.random.default_rng(0))
        is_sign = scan.truth.classes == SemanticClass.TRAFFIC_SIGN
        return scan.points_velo[is_sign]

    front, back = returns(0.0), returns(np.pi)
    assert min(len(front), len(back)) > 40
    assert np.median(front[:, 3]) > 0.8
    assert np.median(back[:, 3]) < 0.5
    height_m = front[:, 2] + HDL_64E.height_m
    assert 0.2 < height_m.min() < height_m.max() < 1.9


def parts_of(shape, amount=60.0):
    config = ClutterConfig(low_furniture=amount)
    return clutter.place_clutter(Road(shape), (0.0, 100.0), config, [], np.random.default_rng(2))


def test_low_furniture_stands_at_the_kerb_and_beyond_or_between_wide_lanes():
    middles = {}
    for lane_m in (3.2, 4.0):
        shape = RoadShape(curvature_1_m=0.0, slope=0.0, lane_m=lane_m)
        sides_m = [
            Road(shape).locate(part.mesh.vertices_m[:, :2].mean(axis=0, keepdims=True))[1][0]
            for part in parts_of(shape)
        ]
        out_m = np.abs(sides_m)
        is_outside = out_m > shape.half_width_m - 0.3
        assert (is_outside | (out_m < 0.4)).all()
        assert (out_m[is_outside] < shape.outer_m + 9).all()
        assert {np.sign(side) for side, out in zip(sides_m, out_m, strict=True) if out > 1} == {
            -1,
            1,
        }
        middles[lane_m] = (~is_outside).sum()
    assert middles[3.2] == 0
    assert middles[4.0] > 5


def test_low_furniture_is_no_labelled_object():
    parts = parts_of(RoadShape())
    assert len(parts) > 100
    assert all(part.instance == 0 and part.box is None for part in parts)
    reflectances = [part.palette[Slot.PANEL, 3] for part in parts]
    assert np.ptp(reflectances) > 0.7


def test_furnished_streets_alone_have_it():
    kinds = [kind for kind in world_kinds.STREETS if kind != "furnished"]
    rng = np.random.default_rng(0)
    assert all(world_kinds.STREETS[kind](rng).clutter.low_furniture == 0 for kind in kinds)
    amounts = [world_kinds.furnished_street(rng).clutter.low_furniture for _ in range(10)]
    assert 4 <= min(amounts) < max(amounts) <= 40


def test_what_is_added_leaves_the_same_street_without_it():
    road = Road(RoadShape())
    amounts = {"bushes": 3.0, "boxes": 3.0, "sites": 2.0}
    plain, furnished = (
        clutter.place_clutter(
            road,
            (0.0, 100.0),
            ClutterConfig(**amounts, low_furniture=low),
            [],
            np.random.default_rng(4),
        )
        for low in (0.0, 5.0)
    )
    first = [part.mesh.vertices_m for part in plain[:5]]
    for vertices_m, part in zip(first, furnished[:5], strict=True):
        assert np.array_equal(vertices_m, part.mesh.vertices_m)
    assert len(furnished) != len(plain)
    assert furniture.keep_right_sign(1.0).vertices_m[:, 2].max() == pytest.approx(1.36)
