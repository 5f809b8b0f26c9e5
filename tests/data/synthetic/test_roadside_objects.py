"""What stands beside a street has the size and the transparency that it claims."""

import numpy as np
import pytest

from data.synthetic import furniture, lidar, meshes, structures, vegetation
from data.synthetic.materials import SemanticClass, Slot, palette
from data.synthetic.road import Road, RoadShape
from data.synthetic.roadside import islands
from data.synthetic.street import Part
from data.synthetic.verge import Verge
from perception.geometry import se3
from perception.sensor import HDL_64E

ACROSS = se3.from_euler(0, 0, np.pi / 2, np.array([10.0, -8.0, 0.0]))
WALL = Part(meshes.box((20.0, -8.0, -1.0), (21.0, 8.0, 4.0), Slot.WALL), palette())


@pytest.mark.parametrize(("wire_m", "low", "high"), [(0.006, 0.03, 0.15), (0.028, 0.2, 0.6)])
def test_some_beams_end_on_a_mesh_fence_and_the_others_behind_it(flat_world, wire_m, low, high):
    fence = Part(meshes.moved(furniture.mesh_fence(16.0, 2.0, wire_m), ACROSS), palette())
    scan = lidar.scan(flat_world([fence, WALL]), HDL_64E, 0.0, np.random.default_rng(0))
    x, y, z = scan.points_velo[:, :3].T
    # Beams that cross the fence 0.3 to 1.9 m over the ground.
    height = z / np.maximum(x, 0.1) * 10.0 + HDL_64E.height_m
    crosses = (x > 9) & (np.abs(y / np.maximum(x, 0.1)) < 0.35) & (height > 0.3) & (height < 1.9)
    on_fence = crosses & (np.abs(x - 10) < 0.2)
    assert low < on_fence.sum() / crosses.sum() < high
    assert (scan.truth.classes[on_fence] == SemanticClass.FENCE).all()


@pytest.mark.parametrize("seed", range(6))
def test_a_trimmed_bush_keeps_its_size(seed):
    size_m = np.array([3.0, 1.5, 1.4])
    mesh = vegetation.trimmed_bush(size_m, np.random.default_rng(seed))
    low, high = np.quantile(mesh.vertices_m, [0.01, 0.99], axis=0)
    extent = high - [low[0], low[1], 0.0]
    # Leaves stick out of a block, a cone is as deep as it is long.
    assert 0.6 * size_m[0] < extent[0] < 1.25 * size_m[0]
    assert extent[1] < max(1.3 * size_m[1], 0.75 * size_m[0])
    assert 0.7 * size_m[2] < extent[2] < 1.3 * size_m[2]


@pytest.mark.parametrize("build", structures.STRUCTURES)
def test_structures_are_as_large_as_vehicles(build):
    for seed in range(3):
        mesh = build(np.random.default_rng(seed))
        length, depth, height = np.ptp(mesh.vertices_m, axis=0)
        assert 1.8 < length < 12.4
        assert 1.5 < depth < 4.3
        assert 0.9 < height < 3.7
        assert np.abs(mesh.vertices_m[:, 0].min() + mesh.vertices_m[:, 0].max()) < 0.1


def test_a_kiosk_is_no_labelled_object(flat_world):
    rng = np.random.default_rng(0)
    pose = se3.from_euler(0, 0, 0, np.array([8.0, 4.0, 0.0]))
    part = Part(meshes.moved(structures.kiosk(rng), pose), structures.paint(rng))
    scan = lidar.scan(flat_world([part]), HDL_64E, 0.0, rng)
    is_near = np.linalg.norm(scan.points_velo[:, :2] - (8, 4), axis=1) < 2.5
    above = is_near & (scan.points_velo[:, 2] > -1.2)
    assert above.sum() > 300
    assert (scan.truth.instances[above] == 0).all()


@pytest.mark.parametrize(("lane_m", "width_m"), [(3.4, None), (4.0, 0.8), (4.9, 1.6)])
def test_traffic_islands_leave_lanes_the_width_of_a_lorry(lane_m, width_m):
    road = Road(RoadShape(curvature_1_m=0.0, slope=0.05, bank=0.0, lane_m=lane_m))
    parts = islands(road, (0.0, 100.0), 6.0, [], np.random.default_rng(0))
    if width_m is None:
        assert parts == []
        return
    assert len(parts) > 12
    low = [part.mesh for part in parts if np.ptp(part.mesh.vertices_m[:, 2]) < 1.0]
    kerbs = [mesh for mesh in low if np.ptp(mesh.vertices_m[:, 0]) > 2.9 and len(mesh) == 12]
    assert len(kerbs) >= 3
    for mesh in kerbs:
        assert np.ptp(mesh.vertices_m[:, 1]) == pytest.approx(width_m, abs=1e-3)
        top_m = mesh.vertices_m[:, 2] - road.place(mesh.vertices_m[:, 0], np.array(0.0))[:, 2]
        assert 0.08 < top_m.max() < 0.2


def test_building_sites_stand_beside_the_carriageway_and_are_lower_than_people_or_fences():
    shape = RoadShape(curvature_1_m=0.0, pavement_m=3.0)
    for seed in range(12):
        verge = Verge(Road(shape), 1, np.random.default_rng(seed), [], [], lambda *_: False)
        parts = verge.site(20.0)
        assert 3 <= len(parts) <= 9
        for part in parts:
            low, high = part.mesh.vertices_m.min(axis=0), part.mesh.vertices_m.max(axis=0)
            assert low[1] > shape.half_width_m - 0.4
            assert 0.4 < high[2] - low[2] < 2.6
            assert part.box is None


@pytest.mark.parametrize(
    ("mesh", "size_m"),
    [
        (furniture.cone(0.75), (0.45, 0.45, 0.77)),
        (furniture.beacon(1.1), (0.4, 0.8, 1.12)),
        (furniture.board_barrier(2.5), (2.5, 0.6, 1.02)),
    ],
)
def test_cones_beacons_and_boards_measure_what_real_ones_do(mesh, size_m):
    assert np.ptp(mesh.vertices_m, axis=0) == pytest.approx(np.array(size_m), abs=0.01)
