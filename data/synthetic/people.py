"""Pedestrians, cyclists and motorcyclists, posed by the phase of their step or of their pedals.

Origin on the ground below the body's centre, x forward, y left, z up.
"""

from dataclasses import dataclass
from enum import Enum
from functools import lru_cache

import numpy as np

from data.synthetic import meshes
from data.synthetic.materials import Slot
from data.synthetic.meshes import Mesh
from data.synthetic.two_wheelers import bicycle, motorcycle, scooter
from perception.types import Float64

PHASES = 12  # poses in one full step or pedal turn
STRIDE_M = 1.45  # way walked in one full step, left and right
PEDAL_M = 5.0  # way ridden in one turn of the pedals

_TALL_M = 1.75  # all measures below are of a person this tall
_CHILD_M = 1.45  # shorter ones have larger heads
_ARM_BEND_RAD = 0.35


class Luggage(Enum):
    """What a pedestrian wears or carries beside clothes."""

    NOTHING = "nothing"
    COAT = "coat"
    BACKPACK = "backpack"
    BAG = "bag"


@dataclass(frozen=True)
class Figure:
    """Build of a pedestrian.

    Attributes:
        height_m: Height from the soles to the hair.
        girth: Width and depth over those of a usual person this tall.
        luggage: What is worn or carried.
        arm_bends_rad: Bend of the left and the right elbow.
    """

    height_m: float
    girth: float = 1.0
    luggage: Luggage = Luggage.NOTHING
    arm_bends_rad: tuple[float, float] = (_ARM_BEND_RAD, _ARM_BEND_RAD)

    def pose(self, phase: int, *, is_walking: bool = True) -> Mesh:
        """Build the pedestrian in one of the poses of a step."""
        usual = pedestrian(_TALL_M, phase, is_walking=is_walking, arm_bends_rad=self.arm_bends_rad)
        body = meshes.merge([usual, *_LUGGAGE[self.luggage]])
        if self.height_m < _CHILD_M:
            body = meshes.merge([body, *_CHILDS_HEAD])
        up = self.height_m / float(body.vertices_m[:, 2].max())
        return meshes.stretched(body, (up * self.girth, up * self.girth, up))


_CHILDS_HEAD = [meshes.ellipsoid((0.04, 0, 1.70), (0.14, 0.115, 0.165), Slot.HAIR, 10)]
_LUGGAGE = {
    Luggage.NOTHING: [],
    Luggage.COAT: [meshes.tube((0, 0, 0.55), (0.01, 0, 1.15), (0.19, 0.15), Slot.SHIRT)],
    Luggage.BACKPACK: [meshes.ellipsoid((-0.20, 0, 1.22), (0.13, 0.16, 0.25), Slot.BICYCLE)],
    Luggage.BAG: [meshes.box((-0.16, -0.31, 0.38), (0.16, -0.21, 0.72), Slot.BICYCLE)],
}


def _limb(joints_m: list[Float64], radii_m: list[float], slot: Slot) -> Mesh:
    """Join neighbouring joints by tubes, and round the joints between them."""
    parts = [
        meshes.tube(a, b, (ra, rb), slot)
        for a, b, ra, rb in zip(joints_m, joints_m[1:], radii_m, radii_m[1:], strict=False)
    ]
    balls = [
        meshes.ellipsoid(j, (r, r, r), slot, 6) for j, r in zip(joints_m, radii_m, strict=True)
    ]
    return meshes.merge(parts + balls)


def _head(neck_m: Float64) -> list[Mesh]:
    """Build neck, face and hair upon the neck's foot."""
    return [
        meshes.tube(neck_m, neck_m + np.array([0.01, 0, 0.12]), (0.055, 0.055), Slot.SKIN),
        meshes.ellipsoid(neck_m + np.array([0.03, 0, 0.20]), (0.095, 0.078, 0.12), Slot.SKIN, 10),
        meshes.ellipsoid(neck_m + np.array([0.005, 0, 0.225]), (0.10, 0.085, 0.115), Slot.HAIR, 10),
    ]


def _torso(hip_m: Float64, neck_m: Float64) -> list[Mesh]:
    """Build hips, waist and chest between the hips' centre and the neck's foot."""
    spine = neck_m - hip_m
    across = np.array([0.0, 1.0, 0.0])
    depth = np.cross(across, spine / np.linalg.norm(spine))
    turn = np.linspace(0, 2 * np.pi, 11)
    share = np.array([-0.12, -0.1, 0.0, 0.25, 0.55, 0.8, 0.95, 1.0, 1.02])
    wide = np.array([0.0, 0.13, 0.17, 0.155, 0.185, 0.20, 0.15, 0.06, 0.0])
    deep = np.array([0.0, 0.10, 0.12, 0.11, 0.125, 0.115, 0.08, 0.05, 0.0])
    ring = (
        hip_m
        + share[:, None, None] * spine
        + (wide[:, None] * np.cos(turn))[..., None] * across
        + (deep[:, None] * np.sin(turn))[..., None] * depth
    )
    slots = np.array([Slot.TROUSERS] * 2 + [Slot.SHIRT] * 6)[:, None]
    return [meshes.smooth(meshes.grid(ring, slots))]


@lru_cache(maxsize=512)
def pedestrian(
    height_m: float,
    phase: int,
    *,
    is_walking: bool = True,
    arm_bends_rad: tuple[float, float] = (_ARM_BEND_RAD, _ARM_BEND_RAD),
) -> Mesh:
    """Build a person in one of the poses of a step."""
    swing = np.sin(2 * np.pi * phase / PHASES) if is_walking else 0.0
    lift = np.cos(2 * np.pi * phase / PHASES) if is_walking else 0.0
    parts: list[Mesh] = []
    hip = np.array([0.0, 0.0, 0.93 - 0.03 * abs(swing)])
    neck = hip + np.array([0.03, 0.0, 0.53])
    for side, arm_bend_rad in zip((1, -1), arm_bends_rad, strict=True):
        thigh_rad = 0.50 * swing * side
        bend_rad = 0.15 + 0.75 * max(0.0, lift * side) if is_walking else 0.03
        parts += _leg(hip + np.array([0, 0.09 * side, 0]), thigh_rad, bend_rad)
        arm_rad = -0.45 * swing * side
        parts += _arm(neck + np.array([-0.01, 0.19 * side, -0.07]), arm_rad, side, arm_bend_rad)
    parts += _torso(hip, neck) + _head(neck)
    return _grown(meshes.merge(parts), height_m)


def _grown(mesh: Mesh, height_m: float) -> Mesh:
    """Scale a body to its height and set its lowest point on the ground."""
    scale = height_m / _TALL_M
    vertices = mesh.vertices_m * np.float32(scale)
    vertices[:, 2] -= vertices[:, 2].min()
    return Mesh(vertices, mesh.triangles, mesh.slots, mesh.normals, mesh.texture_m)


def _swung(angle_rad: float, length_m: float) -> Float64:
    """Return the way down a limb that is swung forward."""
    return length_m * np.array([np.sin(angle_rad), 0.0, -np.cos(angle_rad)])


def _leg(hip_m: Float64, thigh_rad: float, bend_rad: float) -> list[Mesh]:
    knee = hip_m + _swung(thigh_rad, 0.43)
    ankle = knee + _swung(thigh_rad - bend_rad, 0.42)
    shoe = ankle + np.array([0.06, 0.0, -0.03])
    return [
        _limb([hip_m, knee, ankle], [0.085, 0.062, 0.045], Slot.TROUSERS),
        meshes.ellipsoid(shoe, (0.14, 0.05, 0.05), Slot.SHOES),
    ]


def _arm(shoulder_m: Float64, angle_rad: float, side: int, bend_rad: float) -> list[Mesh]:
    elbow = shoulder_m + _swung(angle_rad, 0.28) + (0, 0.03 * side, 0)
    hand = elbow + _swung(angle_rad + bend_rad, 0.27)
    return [
        _limb([shoulder_m, elbow, hand], [0.06, 0.048, 0.038], Slot.SHIRT),
        meshes.ellipsoid(hand, (0.045, 0.03, 0.06), Slot.SKIN, 6),
    ]


@lru_cache(maxsize=512)
def cyclist(height_m: float, phase: int) -> Mesh:
    """Build a bicycle and its rider in one of the poses of a pedal turn."""
    parts = [bicycle()]
    hip, neck = np.array([-0.22, 0, 0.98]), np.array([0.06, 0, 1.44])
    turn = -2 * np.pi * phase / PHASES
    for side in (1, -1):
        pedal = np.array([-0.08, 0.10 * side, 0.30]) + 0.17 * side * np.array(
            [np.cos(turn), 0, np.sin(turn)]
        )
        joint = hip + np.array([0, 0.09 * side, 0])
        ankle = pedal + np.array([-0.05, 0, 0.09])
        knee = _knee(joint, ankle, 0.43, 0.43)
        parts += [
            _limb([joint, knee, ankle], [0.085, 0.062, 0.045], Slot.TROUSERS),
            meshes.ellipsoid(pedal + np.array([0.02, 0, 0.04]), (0.13, 0.05, 0.045), Slot.SHOES),
        ]
        shoulder, grip = (
            neck + np.array([0.0, 0.19 * side, -0.06]),
            np.array([0.44, 0.25 * side, 1.02]),
        )
        elbow = (shoulder + grip) / 2 + np.array([-0.02, 0.05 * side, -0.09])
        parts.append(_limb([shoulder, elbow, grip], [0.06, 0.048, 0.038], Slot.SHIRT))
    parts += _torso(hip, neck) + _head(neck)
    return _grown(meshes.merge(parts), height_m)


@lru_cache(maxsize=64)
def motorcyclist(height_m: float, *, is_scooter: bool) -> Mesh:
    """Build a motorcycle or a scooter and its rider with a helmet."""
    vehicle = scooter() if is_scooter else motorcycle()
    hip = np.array([-0.40, 0, 0.90])
    neck = np.array([-0.30, 0, 1.40] if is_scooter else [-0.15, 0, 1.35])
    foot_x_m, grip_z_m = (0.18, 1.08) if is_scooter else (-0.08, 1.05)
    parts = [vehicle]
    for side in (1, -1):
        joint = hip + np.array([0, 0.12 * side, 0])
        ankle = np.array([foot_x_m, 0.20 * side, 0.40])
        knee = _knee(joint, ankle, 0.43, 0.43) + np.array([0, 0.05 * side, 0])
        shoulder = neck + np.array([0, 0.19 * side, -0.06])
        grip = np.array([0.36, 0.31 * side, grip_z_m])
        elbow = (shoulder + grip) / 2 + np.array([-0.02, 0.07 * side, -0.09])
        parts += [
            _limb([joint, knee, ankle], [0.09, 0.07, 0.05], Slot.TROUSERS),
            meshes.ellipsoid(ankle + np.array([0.07, 0, -0.05]), (0.14, 0.05, 0.05), Slot.SHOES),
            _limb([shoulder, elbow, grip], [0.07, 0.055, 0.045], Slot.SHIRT),
        ]
    face = neck + np.array([0.03, 0, 0.19])
    helmet = meshes.ellipsoid(face, (0.15, 0.13, 0.15), Slot.PAINT, 10)
    return _grown(meshes.merge([*parts, *_torso(hip, neck), helmet]), height_m)


def _knee(hip_m: Float64, ankle_m: Float64, thigh_m: float, shin_m: float) -> Float64:
    """Return where a leg bends, forward, between hip and ankle."""
    leg_m = ankle_m - hip_m
    reach = min(float(np.linalg.norm(leg_m)), 0.999 * (thigh_m + shin_m))
    along = (thigh_m**2 - shin_m**2 + reach**2) / (2 * reach)
    out = np.sqrt(max(thigh_m**2 - along**2, 0.0))
    unit = leg_m / np.linalg.norm(leg_m)
    forward = np.array([1.0, 0, 0]) - unit * unit[0]
    return np.asarray(hip_m + along * unit + out * forward / np.linalg.norm(forward))
