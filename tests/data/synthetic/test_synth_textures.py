"""Textures of the panels and panes of cars, at texture coordinates small enough to read by eye."""

import numpy as np
import pytest

from data.synthetic import vehicles
from data.synthetic.materials import CAR_PAINTS, Slot, random_paint
from data.synthetic.textures import END_U, SILL_V, VARIANT_V, pane, panel
from data.synthetic.vehicle_designs import BodyStyle, draw_design

RED = (0.4, 0.02, 0.02)


def painted(u: float, share: float, variant: int) -> np.ndarray:
    place = np.array([[u, variant * VARIANT_V + SILL_V + share]], np.float32)
    return panel(place, np.array([RED], np.float32), np.ones(1, np.float32))[0]


def test_a_strip_a_sill_and_a_handle_are_drawn_where_a_car_has_them():
    strip, sill = 0.42, 0.10
    # The first bit of a variant is its strip, the second its sill, the third chrome handles.
    assert painted(1.0, strip, 0b1001)[0] < 0.03 < painted(1.0, strip, 0b1000)[0]
    assert painted(1.0, sill, 0b1010)[0] < 0.03 < painted(1.0, sill, 0b1000)[0]
    dark, chrome = painted(0.04, 0.84, 0b1000), painted(0.04, 0.84, 0b1100)
    assert np.ptp(dark) < 0.01
    assert chrome.mean() > 0.4


def test_the_ends_have_a_badge_and_a_gap_over_the_bumper():
    assert painted(END_U, 0.86, 8).mean() > 0.4
    assert painted(END_U, 0.47, 8)[0] < 0.5 * painted(END_U, 0.6, 8)[0]


def test_what_has_no_coordinates_of_a_body_keeps_its_paint():
    place = np.array([[0.3, 1.2], [0.0, 0.0]], np.float32)
    colours = np.array([RED, RED], np.float32)
    assert panel(place, colours, np.ones(2, np.float32)) == pytest.approx(colours)


def test_a_pane_is_uneven_and_dark():
    rng = np.random.default_rng(0)
    place = rng.uniform(0, 3, (4000, 2)).astype(np.float32)
    seen = pane(place, np.full((4000, 3), 0.01, np.float32), np.ones(4000, np.float32))
    assert seen.std() > 0.002
    assert 0.005 < np.median(seen) < 0.015
    assert seen.max() < 0.06


def test_a_body_carries_coordinates_from_sill_to_waist():
    design = draw_design(BodyStyle.HATCHBACK, np.random.default_rng(0))
    mesh = vehicles.build(design)
    is_body = (mesh.slots == Slot.PAINT) & (mesh.texture_m[:, 0, 1] >= VARIANT_V)
    share = np.mod(mesh.texture_m[is_body][..., 1], VARIANT_V) - SILL_V
    corners = mesh.vertices_m[mesh.triangles[is_body]]
    at_waist = np.abs(share - 1) < 0.02
    assert np.abs(corners[at_waist][:, 2] - design.belt_m).max() < 0.03
    assert is_body.sum() > 300


def test_three_in_four_cars_are_black_white_or_grey():
    grey = sum(share for (r, g, b, _), share in CAR_PAINTS if max(r, g, b) < 1.3 * min(r, g, b))
    assert 0.68 < grey / sum(share for _, share in CAR_PAINTS) < 0.82
    drawn = np.array([random_paint(np.random.default_rng(s)) for s in range(600)])[:, :3]
    assert 0.65 < (drawn.max(axis=1) < 1.4 * drawn.min(axis=1)).mean() < 0.85
