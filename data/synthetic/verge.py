"""What stands on one side of a road: plants, rails and fences, boxes, poles, structures."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from data.synthetic import (
    furniture,
    low_furniture,
    meshes,
    street,
    structures,
    two_wheelers,
    vegetation,
)
from data.synthetic.materials import SemanticClass, Slot, palette, random_clothes, random_paint
from data.synthetic.meshes import Mesh
from data.synthetic.road import Road
from data.synthetic.roadside import Plot, draw_pole
from data.synthetic.street import Part, StaticBox
from data.synthetic.town import IsFree
from perception.geometry import se3
from perception.types import Float32, Float64

RAIL_M = 10.0  # length of the pieces of rails and fences, which follow a curve
_ROWS = 0.3  # share of thickets that are rows
_LAND_M = 16.0  # how far beside the road bushes grow
_FAR_M = 35.0  # the same of rows of trees, hedges and fences


@dataclass(frozen=True)
class Verge:
    """One side of a road, on which clutter is placed.

    Attributes:
        road: Road.
        side: Side of the road: 1 left, -1 right.
        rng: Random generator of positions and shapes.
        shrubs: Bushes 1 m high, to be stretched.
        grasses: Patches of grass 1 m high, to be stretched.
        is_free: Function that tells whether large objects may stand beside the road.
    """

    road: Road
    side: int
    rng: np.random.Generator
    shrubs: Sequence[Mesh]
    grasses: Sequence[Mesh]
    is_free: IsFree

    def thicket(self, s_m: float) -> list[Part]:
        """Let some bushes of one kind grow close together, or in a row as a wild hedge."""
        rng = self.rng
        is_row = rng.random() < _ROWS
        appearance, height_m = vegetation.foliage_palette(rng), float(rng.uniform(0.4, 2.6))
        height_m *= 1.6 if is_row else 1.0
        count = int(rng.integers(4, 13) if is_row else rng.integers(1, 7))
        sizes_m = height_m * rng.uniform([0.6, 0.6, 0.6], [1.8, 1.5, 1.2], (count, 3))
        along_m = 0.8 * height_m * (np.arange(count) - count / 2) * is_row
        places_m = rng.normal(0, (0.4, 0.3) if is_row else (2.5, 1.2), (count, 2))
        places_m += np.column_stack([s_m + along_m, np.full(count, _LAND_M * rng.random() ** 1.5)])
        # None grows over the pavement.
        room_m = 0.5 * sizes_m[:, :2].max(axis=1)
        places_m[:, 1] = self.road.shape.outer_m + np.maximum(places_m[:, 1], room_m)
        kinds = rng.integers(len(self.shrubs), size=count)
        return [
            self._grown(self.shrubs[kind], place, size, appearance)
            for kind, place, size in zip(kinds, places_m, sizes_m, strict=True)
        ]

    def grass(self, s_m: float) -> list[Part]:
        """Let grass grow on the land, or along the kerb."""
        shape = self.road.shape
        out_m = shape.outer_m + float(self.rng.uniform(0.2, 7))
        if self.rng.random() < 0.25:
            out_m = shape.half_width_m + float(self.rng.uniform(0.1, 0.4))
        size_m = self.rng.uniform([0.6, 0.5, 0.15], [2.5, 1.5, 0.7])
        mesh = self.grasses[int(self.rng.integers(len(self.grasses)))]
        place_m, appearance = np.array([s_m, out_m]), vegetation.foliage_palette(self.rng)
        return [self._grown(mesh, place_m, size_m, appearance)]

    def _grown(self, mesh: Mesh, place_m: Float64, size_m: Float64, appearance: Float32) -> Part:
        """Stretch a plant by a factor along each axis, and plant it at s and a distance from the centreline."""
        turn = float(self.rng.uniform(0, 2 * np.pi))
        pose = street.upright_pose(self.road, place_m[0], self.side * place_m[1], turn)
        return Part(meshes.moved(meshes.stretched(mesh, size_m), pose), appearance)

    def conifer(self, s_m: float) -> list[Part]:
        """Plant a fir, or a young tree, or a row of them."""
        height_m = float(self.rng.uniform(1.5, 9))
        out_m = self.road.shape.outer_m + float(
            self.rng.uniform(vegetation.CROWN_REACH * height_m, _LAND_M)
        )
        mesh = vegetation.conifer(height_m, self.rng, leaves=600)
        appearance, row = vegetation.foliage_palette(self.rng), int(self.rng.choice([1, 1, 2, 4]))
        return [
            self._grown(
                mesh, np.array([s_m + 2.2 * n, out_m]), self.rng.uniform(0.8, 1.2, 3), appearance
            )
            for n in range(row)
        ]

    def trimmed(self, s_m: float) -> list[Part]:
        """Plant a trimmed bush, or a row of them, as large as a car at most."""
        rng = self.rng
        size_m = rng.uniform([0.9, 0.8, 0.7], [4.8, 2.0, 2.0])
        count = int(rng.choice([1, 1, 1, 2, 4])) if size_m[0] < 2.5 else 1
        out_m = self.road.shape.outer_m + size_m[0] / 2 + float(4 * rng.random() ** 2)
        turn = float(rng.choice([0.0, 0.0, np.pi / 2, 0.3]))
        bush, appearance = vegetation.trimmed_bush(size_m, rng), vegetation.foliage_palette(rng)
        return [
            self._placed(bush, s_m + 1.3 * size_m[0] * n, out_m, turn, appearance)
            for n in range(count)
            if self.is_free(s_m + 1.3 * size_m[0] * n - 2.5, 5.0, self.side)
        ]

    def structure(self, s_m: float) -> list[Part]:
        """Set up a kiosk, a cabin, a container or a skip."""
        build = structures.STRUCTURES[int(self.rng.integers(len(structures.STRUCTURES)))]
        mesh, turn = build(self.rng), float(self.rng.normal(0, 0.05))
        out_m = self.road.shape.outer_m + mesh.radius_m * 0.3 + float(self.rng.uniform(0.8, 4))
        placed = self._placed(mesh, s_m, out_m, turn, structures.paint(self.rng))
        half_m = mesh.radius_m
        return [placed] if self.is_free(s_m - half_m, 2 * half_m, self.side) else []

    def enclosure(self, s_m: float) -> list[Part]:
        """Set up a mesh fence, a hedge or a row of trees along the road, near it or far from it."""
        rng, shape = self.rng, self.road.shape
        count, out_m = int(rng.integers(3, 9)), shape.outer_m + float(rng.uniform(0.5, _FAR_M))
        appearance, height_m = furniture.panel_palette(rng), float(rng.uniform(1.0, 2.4))
        kind = rng.random()
        if kind < 0.5:
            piece = furniture.mesh_fence(RAIL_M, height_m, self._wire_m())
        elif kind < 0.8:
            appearance = vegetation.foliage_palette(rng)
            piece = vegetation.hedge(RAIL_M, height_m, rng)
        else:
            return self._tree_row(s_m, count, out_m + 2.5)
        return [
            self._fronting(piece, s_m + RAIL_M * n, out_m, appearance)
            for n in range(count)
            if self.is_free(s_m + RAIL_M * n, RAIL_M, self.side)
        ]

    def _tree_row(self, s_m: float, count: int, out_m: float) -> list[Part]:
        """Plant trees of one kind in a row."""
        rng, height_m = self.rng, float(self.rng.uniform(4, 9))
        appearance, apart_m = vegetation.foliage_palette(rng), 0.8 * height_m
        return [
            self._placed(
                vegetation.tree(height_m, rng, leaves=700), s_m + apart_m * n, out_m, 0, appearance
            )
            for n in range(2 * count)
            if self.is_free(s_m + apart_m * n - apart_m / 2, apart_m, self.side)
        ]

    def _wire_m(self) -> float:
        """Draw the width of a fence's wires: an eighth to a half of the beams ends on it."""
        return float(self.rng.uniform(0.006, 0.028))

    def _placed(
        self, mesh: Mesh, s_m: float, out_m: float, turn_rad: float, appearance: Float32
    ) -> Part:
        """Stand an object, its front towards the road, at s and a distance from the centreline."""
        front = turn_rad + (0.0 if self.side > 0 else np.pi)
        pose = street.upright_pose(self.road, s_m, self.side * out_m, front)
        return Part(meshes.moved(mesh, pose), appearance)

    def rail(self, s_m: float) -> list[Part]:
        """Set up pieces of a guard rail or a barrier, one after another."""
        is_steel, appearance = self.rng.random() < 0.8, furniture.panel_palette(self.rng)
        mesh = (furniture.guard_rail if is_steel else furniture.barrier)(RAIL_M)
        edge_m = self.road.shape.half_width_m + 0.45
        count = int(self.rng.integers(1, 5))
        return [self._fronting(mesh, s_m + RAIL_M * n, edge_m, appearance) for n in range(count)]

    def site(self, s_m: float) -> list[Part]:
        """Set up a building site: cones, beacons, boards or a mesh fence along the kerb, and at times a skip."""
        rng, shape, kind = self.rng, self.road.shape, self.rng.random()
        colour = (0.5, 0.12, 0.02) if kind < 0.5 else (0.7, 0.7, 0.68)
        sign = {Slot.SIGN: (0.75, 0.75, 0.75, float(rng.uniform(0.6, 0.99)))}
        appearance = palette({Slot.PANEL: (*colour, float(rng.uniform(0.2, 0.7))), **sign})
        count, out_m = int(rng.integers(3, 10)), shape.half_width_m + float(rng.uniform(0.2, 0.6))
        if kind < 0.55:
            height_m, apart_m = float(rng.uniform(0.45, 1.05)), float(rng.uniform(1.5, 5))
            mesh = furniture.cone(height_m) if kind < 0.35 else furniture.beacon(height_m + 0.2)
            parts = [
                self._placed(mesh, s_m + apart_m * n, out_m, float(rng.normal(0, 0.2)), appearance)
                for n in range(count)
            ]
        else:
            length_m = float(rng.uniform(1.8, 3.5))
            piece = (
                furniture.board_barrier(length_m)
                if kind < 0.75
                else furniture.mesh_fence(length_m, 2.0, self._wire_m())
            )
            turn = float(rng.normal(0, 0.06))
            parts = [
                self._placed(piece, s_m + length_m * n, out_m, turn, appearance)
                for n in range(count)
            ]
        return parts + (self.structure(s_m + 4.0) if rng.random() < 0.4 else [])

    def railing(self, s_m: float) -> list[Part]:
        """Set up a railing at the kerb or behind the pavement, or a fence of wire behind it."""
        appearance, edge_m = furniture.panel_palette(self.rng), self.road.shape.outer_m + 0.25
        height_m = float(self.rng.uniform(0.9, 1.3))
        if self.rng.random() < 0.4:
            return [
                self._fronting(
                    furniture.mesh_fence(RAIL_M, 1.6 * height_m, self._wire_m()),
                    s_m,
                    edge_m,
                    appearance,
                )
            ]
        if self.rng.random() < 0.5:
            edge_m = self.road.shape.half_width_m + 0.3
        return [self._fronting(furniture.railing(RAIL_M, height_m), s_m, edge_m, appearance)]

    def _fronting(self, mesh: Mesh, s_m: float, edge_m: float, appearance: Float32) -> Part:
        pose = street.facade_pose(self.road, s_m, RAIL_M, self.side * edge_m)
        return Part(meshes.moved(mesh, pose), appearance)

    def box(self, s_m: float) -> list[Part]:
        """Place one of the boxes, boards and racks behind the pavement."""
        draw = self.rng.random()
        if draw < 0.12:
            return self.bicycles(s_m)
        for share, build in (
            (0.40, furniture.cabinet),
            (0.65, furniture.bins),
            (0.75, furniture.pillar),
            (0.90, furniture.billboard),
        ):
            if draw < share:
                return [self._behind_pavement(build(self.rng), s_m)]
        return [self._behind_pavement(furniture.bench(), s_m)]

    def shelter(self, s_m: float) -> list[Part]:
        """Set up a bus stop."""
        return [self._behind_pavement(furniture.shelter(self.rng), s_m)]

    def _behind_pavement(self, mesh: Mesh, s_m: float) -> Part:
        turn = (0.0 if self.side > 0 else np.pi) + float(self.rng.normal(0, 0.1))
        if self.rng.random() < 0.15:
            turn += np.pi / 2
        out_m = self.road.shape.outer_m + float(self.rng.uniform(-0.6, 0.3))
        pose = street.upright_pose(self.road, s_m, self.side * out_m, turn)
        return Part(meshes.moved(mesh, pose), furniture.panel_palette(self.rng))

    def bicycles(self, s_m: float) -> list[Part]:
        """Park bicycles in a row behind the pavement, at stands or without, or along a wall."""
        rng = self.rng
        if rng.random() < 0.2:
            # Leaning against what stands behind the pavement, one behind another.
            out_m, turn = self.road.shape.outer_m - 0.3, float(rng.choice([0.0, np.pi]))
            return [
                self._bicycle(s_m + 1.9 * number, out_m, turn)
                for number in range(int(rng.integers(1, 4)))
            ]
        count = int(rng.integers(1, 7) if rng.random() < 0.75 else rng.integers(6, 13))
        return self._bicycle_row(s_m, count, self.road.shape.outer_m - 0.9)

    def _bicycle_row(self, s_m: float, count: int, out_m: float) -> list[Part]:
        """Park bicycles side by side at one angle, two to a stand."""
        rng = self.rng
        has_stands, angle = rng.random() < 0.5, float(rng.choice([0.5, 0.5, 0.3])) * np.pi
        apart_m = float(rng.uniform(0.45, 0.7)) / np.sin(angle)
        parts = [
            self._bicycle(s_m + apart_m * number, out_m, angle + np.pi * float(rng.integers(2)))
            for number in range(count)
            if rng.random() < 0.85
        ]
        stands = np.arange(0, count if has_stands else 0, 2) + 0.5
        return parts + [
            self._placed(furniture.bicycle_stand(), s_m + apart_m * stand, out_m, angle, palette())
            for stand in stands.tolist()
        ]

    def _bicycle(self, s_m: float, out_m: float, turn_rad: float) -> Part:
        turn = turn_rad + float(self.rng.normal(0, 0.1))
        return self._two_wheeler(
            "Bicycle", two_wheelers.bicycle(), (s_m, out_m, turn), random_clothes(self.rng)
        )

    def motorcycles(self, s_m: float) -> list[Part]:
        """Park motorcycles and scooters behind the pavement."""
        return self._motorcycle_row(
            s_m, int(self.rng.integers(1, 7)), self.road.shape.outer_m - 1.2
        )

    def _motorcycle_row(self, s_m: float, count: int, out_m: float) -> list[Part]:
        """Park motorcycles and scooters side by side, all at about the same angle."""
        rng = self.rng
        angle = float(rng.choice([0.5, 0.4, 0.3])) * np.pi + np.pi * float(rng.integers(2))
        apart_m = float(rng.uniform(0.9, 1.2)) / abs(np.sin(angle))
        return [
            self._motorcycle(s_m + apart_m * number, out_m, angle + float(rng.normal(0, 0.06)))
            for number in range(count)
        ]

    def _motorcycle(self, s_m: float, out_m: float, turn_rad: float) -> Part:
        build = two_wheelers.scooter if self.rng.random() < 0.5 else two_wheelers.motorcycle
        mesh = meshes.stretched(build(), self.rng.uniform(0.92, 1.08, 3))
        appearance = palette({Slot.PAINT: random_paint(self.rng)})
        return self._two_wheeler("Motorcycle", mesh, (s_m, out_m, turn_rad), appearance)

    def _two_wheeler(
        self, category: str, mesh: Mesh, place: tuple[float, float, float], appearance: Float32
    ) -> Part:
        """Stand a two-wheeler on its side stand at s, a distance from the centreline, and an angle."""
        s_m, out_m, turn = place
        pose = street.upright_pose(self.road, s_m, self.side * out_m, turn)
        leaning = pose @ se3.from_euler(float(self.rng.normal(-0.1, 0.05)), 0.0, 0.0)
        placed = meshes.moved(mesh, leaning)
        box = StaticBox.around(category, placed, pose)
        return Part(placed, appearance, SemanticClass.OTHER_OBJECT, box=box)

    def bay(self, bay: Plot) -> list[Part]:
        """Fill a parking bay with a bed of plants, motorcycles or bicycles, or a bed at the kerb."""
        shape, draw = self.road.shape, self.rng.random()
        if shape.parking_m < 1.8:
            return self._bed(bay, shape.half_width_m + 0.55, 0.7)
        out_m = shape.half_width_m - min(shape.parking_m, 2.4) / 2
        if draw < 0.5:
            return self._bed(bay, out_m, min(shape.parking_m, 2.4) - 0.3)
        if draw < 0.8:
            return self._motorcycle_row(bay.s_m + 0.5, int(bay.length_m / 1.7), out_m)
        return self._bicycle_row(bay.s_m + 0.5, int(bay.length_m / 0.9), out_m)

    def _bed(self, bay: Plot, out_m: float, depth_m: float) -> list[Part]:
        """Plant a bed: a trimmed hedge, bushes or grass, with a young tree in some."""
        rng, middle_m = self.rng, bay.middle_m
        bed = furniture.planted_bed(bay.length_m, depth_m)
        pose = street.sloped_pose(self.road, middle_m, self.side * out_m)
        parts = [Part(meshes.moved(bed, pose), palette())]
        appearance, height_m = vegetation.foliage_palette(rng), float(rng.uniform(0.4, 1.7))
        if rng.random() < 0.4:
            size_m = [bay.length_m - 0.6, 0.75 * depth_m, height_m]
            hedge = vegetation.trimmed(vegetation.block(size_m), rng)
            parts.append(Part(meshes.moved(hedge, pose), appearance))
        else:
            plants = self.shrubs if rng.random() < 0.7 else self.grasses
            size_m = [0.9 * depth_m, 0.9 * depth_m, height_m]
            half_m = bay.length_m / 2 - 0.5 * depth_m
            for s_m in middle_m + np.arange(-half_m, half_m + 0.01, 0.7 * depth_m):
                plant, stretch = plants[int(rng.integers(len(plants)))], rng.uniform(0.6, 1.0, 3)
                place_m = np.array([s_m, out_m])
                parts.append(self._grown(plant, place_m, stretch * size_m, appearance))
        if rng.random() < 0.3:
            tree = vegetation.tree(float(rng.uniform(3.5, 6)), rng, leaves=700)
            parts.append(self._placed(tree, middle_m, out_m, 0.0, vegetation.foliage_palette(rng)))
        return parts

    def poles(self, s_m: float) -> list[Part]:
        """Stand poles together, as at the corner of a junction."""
        shape = self.road.shape
        width_m = max(shape.pavement_m - 0.6, 0.5)
        return [
            draw_pole(self.road, self.rng, s_m + float(self.rng.normal(0, 1.6)), self.side * (shape.half_width_m + 0.35 + width_m * float(self.rng.random())))
            for _ in range(int(self.rng.integers(1, 6)))
        ]  # fmt: skip

    def delineator(self, s_m: float) -> list[Part]:
        """Stand a white post at the road's edge."""
        l_m = self.side * (self.road.shape.half_width_m + 0.5)
        pose = street.upright_pose(self.road, s_m, l_m, np.pi if self.side > 0 else 0.0)
        return [Part(meshes.moved(furniture.delineator(), pose), palette())]

    def low_furniture(self, s_m: float) -> list[Part]:
        """Stand one kind of low furniture, alone or in a row, at the kerb, on the pavement or behind it.

        Signs and beacons stand between the lanes too, where a lorry passes on either side.
        """
        rng, shape = self.rng, self.road.shape
        shares = np.array([share for _, share, _ in low_furniture.KINDS])
        number = int(rng.choice(len(shares), p=shares / shares.sum()))
        build, _, most = low_furniture.KINDS[number]
        count = int(rng.integers(1, most + 1)) if rng.random() < 0.5 else 1
        place, apart_m = rng.random(), float(rng.uniform(1.2, 4.0))
        out_m = shape.half_width_m + float(rng.uniform(0.2, 0.7))
        if number < 2 and place < 0.35 and shape.lane_m > 3.4:
            out_m = 0.0
        elif place > 0.85:
            out_m = shape.outer_m + float(rng.uniform(0.3, 8.0))
        elif place > 0.55:
            out_m += max(shape.pavement_m - 0.7, 0.0) * float(rng.random())
        mesh, appearance = build(rng), low_furniture.low_palette(rng)
        # Towards what comes on this side, or another way.
        turn = np.pi * (float(rng.choice([0.0, 0.0, 0.5, 1.0])) + (self.side < 0))
        return [
            self._placed(
                mesh, s_m + apart_m * n, out_m, turn + float(rng.normal(0, 0.15)), appearance
            )
            for n in range(count)
            if out_m < shape.outer_m or self.is_free(s_m + apart_m * n - 1.0, 2.0, self.side)
        ]
