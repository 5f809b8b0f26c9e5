import numpy as np
import pytest

from perception.tracking.single_object.config import PitchGroundConfig
from perception.tracking.single_object.pitch_ground import (
    PitchedPlane,
    PitchFilter,
    angle_density,
    bandwidth,
    dominant_angle,
    elevation_angles,
)
from tests.reference.pitch import reference_density, reference_mode_rad

HEIGHT_M = 1.73
ANYWHERE = (-0.2, 0.2)
CONFIG = PitchGroundConfig()


def road_and_clutter(pitch_rad: float, rng: np.random.Generator) -> np.ndarray:
    """Return (N, 4) points: a plane through the point under the sensor, and clutter above it at any height."""
    x, y = rng.uniform(5, 40, 4000), rng.uniform(-10, 10, 4000)
    ground = np.column_stack([x, y, np.tan(pitch_rad) * x - HEIGHT_M + rng.normal(0, 0.02, 4000)])
    clutter = np.column_stack([x[:2000], y[:2000], rng.uniform(-HEIGHT_M, 0.5, 2000)])
    return np.column_stack([np.vstack([ground, clutter]), np.zeros(6000)]).astype(np.float32)


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(3)


@pytest.mark.parametrize("pitch_deg", [-1.2, 0.0, 0.8])
def test_peak_is_that_of_the_reference_density(rng, pitch_deg):
    angles = elevation_angles(road_and_clutter(np.radians(pitch_deg), rng), HEIGHT_M, CONFIG)
    at_rad = np.radians(np.arange(-3, 3, 0.01))
    plain_rad = reference_mode_rad(angles, at_rad, bandwidth(angles))
    found_rad = dominant_angle(angles, ANYWHERE, CONFIG)
    assert found_rad == pytest.approx(plain_rad, abs=np.radians(0.02))
    assert found_rad == pytest.approx(np.radians(pitch_deg), abs=np.radians(0.15))


def test_the_density_is_that_of_the_reference(rng):
    angles = elevation_angles(road_and_clutter(np.radians(0.5), rng), HEIGHT_M, CONFIG)
    middles_rad, density = angle_density(angles, CONFIG)
    near = np.abs(middles_rad) < np.radians(3)
    expected = reference_density(angles, middles_rad[near], bandwidth(angles))
    np.testing.assert_allclose(density[near], expected, atol=0.02 * expected.max())
    assert density.sum() * CONFIG.bin_rad == pytest.approx(1, abs=0.01)


def test_without_angles_the_density_is_zero():
    assert not angle_density(np.zeros(0), CONFIG)[1].any()


def test_only_what_lies_ahead_and_near_the_level_has_an_angle():
    points = np.array([[10, 0, -1.73, 0], [-10, 0, -1.73, 0], [10, 15, -1.73, 0], [10, 0, 1, 0]])
    np.testing.assert_allclose(elevation_angles(points, HEIGHT_M, CONFIG), [0.0], atol=1e-12)


def test_a_peak_outside_the_interval_is_none(rng):
    angles = rng.normal(0.02, 0.001, 2000)
    assert dominant_angle(angles, (-0.01, 0.01), CONFIG) is None
    assert dominant_angle(angles, (0.0, 0.04), CONFIG) == pytest.approx(0.02, abs=0.001)


@pytest.mark.parametrize("angles", [np.zeros(0), np.array([np.nan]), np.array([1.0])])
def test_no_angle_has_no_peak(angles):
    assert dominant_angle(angles, ANYWHERE, CONFIG) is None


def test_angles_all_alike_have_a_peak():
    assert dominant_angle(np.full(5, 0.011), ANYWHERE, CONFIG) == pytest.approx(0.011, abs=2e-4)


def test_plane_measures_along_its_normal():
    plane = PitchedPlane(np.radians(30), 2.0)
    np.testing.assert_allclose(plane.height_m(np.array([[0, 5], [np.sqrt(3), 0]])), [-2.0, -1.0])
    above = np.array([[0, 0, -2], [0, 0, 0], [np.sqrt(3), 9, -1]])
    np.testing.assert_allclose(plane.distance_m(above), [0, np.sqrt(3), 0], atol=1e-12)


def test_filter_follows_a_pitch_that_swings(rng):
    pitch = PitchFilter(HEIGHT_M)
    errors_rad = []
    for step in range(30):
        pitch_rad = np.radians(0.6 * np.sin(0.3 * step))
        plane = pitch.update(road_and_clutter(pitch_rad, rng), 0.1)
        errors_rad.append(plane.pitch_rad - pitch_rad)
    assert np.abs(errors_rad).mean() < np.radians(0.12)


def test_scan_without_ground_keeps_the_prediction(rng):
    pitch = PitchFilter(HEIGHT_M)
    for _ in range(5):
        before = pitch.update(road_and_clutter(0.01, rng), 0.1)
    after = pitch.update(np.zeros((0, 4), np.float32), 0.1)
    assert after.pitch_rad == pytest.approx(before.pitch_rad, abs=np.radians(0.05))


def test_the_gate_holds_a_sudden_angle_back_and_widens(rng):
    pitch = PitchFilter(HEIGHT_M)
    for _ in range(5):
        pitch.update(road_and_clutter(0.0, rng), 0.1)
    angles_rad = [
        pitch.update(road_and_clutter(np.radians(1.5), rng), 0.1).pitch_rad for _ in range(12)
    ]
    assert abs(angles_rad[0]) < np.radians(0.4)
    assert angles_rad[-1] == pytest.approx(np.radians(1.5), abs=np.radians(0.2))


def test_the_first_scans_may_be_empty(rng):
    pitch = PitchFilter(HEIGHT_M)
    assert pitch.update(np.zeros((0, 4), np.float32), 0.0).pitch_rad == 0.0
    found = pitch.update(road_and_clutter(0.02, rng), 0.1)
    assert found.pitch_rad == pytest.approx(0.02, abs=np.radians(0.15))
