"""Faults are written into the corner, and a healthy frame is drawn as it was."""

import numpy as np

from perception.render.strip import draw_health
from perception.types import Health, HealthFinding, HealthLevel


def test_a_healthy_frame_is_left_as_it_is():
    canvas = np.full((90, 320, 3), 7, np.uint8)
    draw_health(canvas, Health(), 10)
    assert (canvas == 7).all()


def test_each_fault_is_a_line_of_the_corner_and_three_are_shown():
    findings = [HealthFinding("camera", HealthLevel.WARN, f"fault {n}", "why") for n in range(5)]
    canvas = np.full((200, 320, 3), 7, np.uint8)
    draw_health(canvas, Health.of(findings), 10)
    rows = np.flatnonzero((canvas != 7).any(axis=(1, 2)))
    assert (rows[0], rows[-1]) == (8, 8 + 3 * 19 - 1)
    assert (canvas[:, 200:] == 7).all()
