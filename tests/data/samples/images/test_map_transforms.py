"""What happens to maps keeps their meaning: metres, reflectances, and nothing known."""

from dataclasses import replace

import numpy as np
import pytest

from data.samples.images.config import MapAugmentationConfig
from data.samples.images.map_transforms import transform_depth_map, transform_reflectance_map
from data.samples.images.photometric import normal_noise
from perception.errors import UsageError
from perception.maps.encoding import decode_depth, encode_depth
from tests.faults import fault

NONE = MapAugmentationConfig.none()


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def plane(depth_m: float) -> np.ndarray:
    """Return a depth map of one depth, of which the upper half is unknown."""
    image = np.full((96, 160, 1), encode_depth(np.float32([[depth_m]])).item(), np.uint8)
    image[:48] = 0
    return image


@pytest.mark.parametrize("depth_m", [12.0, 20.0, 40.0])
@pytest.mark.parametrize("zoom", [0.5, 1.25, 2.0])
def test_what_is_zoomed_is_as_much_nearer(depth_m: float, zoom: float):
    transformed = transform_depth_map(plane(depth_m), zoom, NONE, rng())
    assert not transformed[:48].any()
    (value,) = np.unique(transformed[48:])
    # The map's own steps, before and after: a step of 1 is d^2 / 1360 m.
    step_m = (depth_m / zoom) ** 2 / 1360 + depth_m**2 / 1360 / zoom
    assert decode_depth(value) == pytest.approx(depth_m / zoom, abs=step_m)


def test_a_plane_at_20_m_zoomed_by_2_is_that_of_10_m():
    transformed = transform_depth_map(plane(20), 2, NONE, rng())
    assert abs(transformed.astype(int) - plane(10)).max() <= 1


def test_a_magnitude_of_zero_leaves_the_map():
    image = rng().integers(0, 256, (96, 160, 1), np.uint8)
    np.testing.assert_array_equal(transform_depth_map(image, 1, NONE, rng()), image)
    np.testing.assert_array_equal(transform_reflectance_map(image, NONE, rng()), image)


def test_errors_of_the_range_are_in_metres():
    magnitudes = replace(NONE, range_noise_m=0.5)
    spreads = []
    for seed in range(40):
        transformed = transform_depth_map(plane(10), 1, magnitudes, rng(seed))
        assert not transformed[:48].any()
        depth_m = decode_depth(transformed[48:])
        spreads.append(depth_m.std())
        assert depth_m.mean() == pytest.approx(10, abs=0.1)
    assert 0.4 < max(spreads) < 0.53
    assert np.median(spreads) == pytest.approx(0.5 * 0.25, abs=0.06)  # a square of a number


def test_lost_cells_are_unknown_and_all_others_stay():
    magnitudes = replace(NONE, dropout=0.6)
    shares = []
    for seed in range(40):
        transformed = transform_depth_map(plane(20), 1, magnitudes, rng(seed))
        assert set(np.unique(transformed)) <= {0, plane(20).max()}
        shares.append((transformed[48:] == 0).mean())
    assert 0.4 < max(shares) < 0.66
    assert min(shares) < 0.02


@pytest.mark.parametrize("is_depth", [True, False])
def test_far_and_weak_returns_fade_first(is_depth: bool):
    magnitudes = replace(NONE, fading=1.0)
    image = np.tile(np.array([[20], [250]], np.uint8).repeat(48, axis=0), (1, 160))[..., None]
    kept = np.zeros(2)
    for seed in range(20):
        args = (image, 1.0) if is_depth else (image,)
        change = transform_depth_map if is_depth else transform_reflectance_map
        transformed = change(*args, magnitudes, rng(seed))
        kept += [(transformed[:48] > 0).mean() / 20, (transformed[48:] > 0).mean() / 20]
    fading, staying = kept[::-1] if is_depth else kept
    assert staying > 0.97
    assert fading < 0.85


def test_a_lost_beam_shows_the_row_above_where_maps_are_filled():
    rows = np.repeat(np.arange(1, 97, dtype=np.uint8), 160).reshape(96, 160, 1)
    magnitudes = replace(NONE, beam_dropout=0.9)
    for seed in range(5):
        filled = transform_reflectance_map(rows, magnitudes, rng(seed))[:, 0, 0].astype(int)
        sparse = transform_reflectance_map(rows, magnitudes, rng(seed), is_filled=False)[:, 0, 0]
        is_lost = sparse == 0
        np.testing.assert_array_equal(sparse[~is_lost], np.arange(1, 97)[~is_lost])
        kept = np.where(is_lost, 1, np.arange(1, 97))
        np.testing.assert_array_equal(filled, np.maximum.accumulate(kept))


def test_other_lidars_change_reflectances_by_one_rising_curve():
    image = np.arange(256, dtype=np.uint8).reshape(16, 16, 1)
    curves = []
    for seed in range(50):
        transformed = transform_reflectance_map(image, replace(NONE, gain=1.0), rng(seed)).ravel()
        assert transformed[0] == 0
        assert (np.diff(transformed.astype(int)) >= 0).all()
        curves.append(transformed[100] / 100)
    assert 0.49 < min(curves) < 0.6
    assert 1.7 < max(curves) < 2.01
    gamma = transform_reflectance_map(image, replace(NONE, gamma=1.0), rng(2)).ravel()
    assert (gamma[0], gamma[255]) == (0, 255)
    assert gamma[100] != 100


def test_speckle_leaves_the_mean_and_what_is_unknown():
    image = np.full((96, 160, 1), 120, np.uint8)
    image[:48] = 0
    for seed in range(10):
        transformed = transform_reflectance_map(image, replace(NONE, speckle=0.3), rng(seed))
        assert not transformed[:48].any()
        assert transformed[48:].mean() == pytest.approx(120, abs=2)
        assert transformed[48:].std() < 40


def test_changes_depend_on_the_generator_alone():
    image, magnitudes = plane(15), MapAugmentationConfig()
    first, again, other = (transform_depth_map(image, 1.1, magnitudes, rng(s)) for s in (3, 3, 4))
    np.testing.assert_array_equal(first, again)
    assert (first != other).any()


def test_noise_is_normal_and_of_any_size():
    noise = normal_noise((100, 200), rng())
    assert noise.mean() == pytest.approx(0, abs=0.03)
    assert noise.std() == pytest.approx(1, abs=0.02)
    assert normal_noise((1300, 1000), rng()).shape == (1300, 1000)
    np.testing.assert_array_equal(normal_noise((100, 200), rng()), noise)


@pytest.mark.parametrize("magnitude", [{"dropout": 1.0}, {"range_noise_m": -0.1}])
def test_a_magnitude_that_cannot_be_is_refused(magnitude: dict[str, float]):
    with fault(UsageError, f"augmentation {next(iter(magnitude))}"):
        MapAugmentationConfig(**magnitude)
