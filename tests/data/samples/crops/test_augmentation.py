"""What is drawn: within its magnitude, reproducible, and each operation alone."""

import numpy as np
import pytest

from data.samples.crops.config import OPERATIONS, CropAugmentationConfig
from data.samples.crops.transforms import CropTransform, draw_transform
from perception.errors import UsageError
from tests.faults import fault


def drawn(magnitudes: CropAugmentationConfig, count: int = 400) -> list[CropTransform]:
    return [draw_transform(magnitudes, np.random.default_rng(seed)) for seed in range(count)]


def is_changed(transform: CropTransform) -> set[str]:
    tests = {
        "scale": transform.scale != 1,
        "depth": transform.depth != 1,
        "flip": transform.is_flipped,
        "jitter": transform.shift != (0, 0),
        "aspect": transform.aspect != 1,
        "occlusion": transform.occlusion is not None,
        "rotation_rad": transform.rotation_rad != 0,
        "row_shift_px": transform.row_shifts_px is not None,
        "reflectance": transform.reflectance != 1,
    }
    return {name for name, is_so in tests.items() if is_so}


def test_without_transforms_the_crop_stays():
    assert all(not is_changed(transform) for transform in drawn(CropAugmentationConfig.none(), 50))


@pytest.mark.parametrize("operation", OPERATIONS)
def test_one_operation_alone(operation: str):
    changed = [
        is_changed(transform) for transform in drawn(CropAugmentationConfig().only(operation), 50)
    ]
    assert set().union(*changed) == {operation}


def test_draws_spread_over_their_magnitude_and_not_beyond():
    magnitudes = CropAugmentationConfig(
        scale=0.2, depth=0.5, jitter=0.1, occlusion=0.3, rotation_rad=0.05
    )
    transforms = drawn(magnitudes)
    scales, depths = np.array([(c.scale, c.depth) for c in transforms]).T
    assert 1 / 1.2 <= scales.min() < 0.85
    assert 1.18 < scales.max() <= 1.2
    assert abs(np.log(depths).mean()) < 0.03  # as often nearer as farther
    assert np.abs([c.shift for c in transforms]).max() == pytest.approx(0.1, abs=0.002)
    assert np.abs([c.rotation_rad for c in transforms]).max() == pytest.approx(0.05, abs=0.001)
    shares = [c.occlusion.share for c in transforms if c.occlusion]
    assert 0.29 < max(shares) <= 0.3
    assert len(shares) / len(transforms) == pytest.approx(0.5, abs=0.1)
    assert np.mean([c.is_flipped for c in transforms]) == pytest.approx(0.5, abs=0.1)


def test_the_same_seed_draws_the_same():
    first, second = (
        draw_transform(CropAugmentationConfig(), np.random.default_rng([1, 2])) for _ in range(2)
    )
    assert (first.scale, first.occlusion, first.shift) == (
        second.scale,
        second.occlusion,
        second.shift,
    )
    np.testing.assert_array_equal(first.row_shifts_px, second.row_shifts_px)


def test_switching_one_off_leaves_the_others_as_drawn():
    whole = draw_transform(CropAugmentationConfig(), np.random.default_rng(5))
    part = draw_transform(
        CropAugmentationConfig(scale=0.0, occlusion=0.0), np.random.default_rng(5)
    )
    assert (part.scale, part.occlusion) == (1.0, None)
    assert (part.depth, part.aspect, part.shift) == (whole.depth, whole.aspect, whole.shift)


@pytest.mark.parametrize(
    ("name", "magnitude"), [("scale", -0.1), ("occlusion", 1.0), ("flip", 2.0)]
)
def test_magnitudes_that_cannot_be_are_refused(name: str, magnitude: float):
    with fault(UsageError, f"augmentation {name}", "a magnitude from 0 to"):
        CropAugmentationConfig(**{name: magnitude})
