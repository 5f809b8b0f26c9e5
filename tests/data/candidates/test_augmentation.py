"""What is drawn: within its strength, reproducible, and each operation alone."""

import numpy as np
import pytest

from data.candidates.augmentation import OPERATIONS, Augmentation, Change, draw_change
from perception.errors import UsageError


def drawn(strengths: Augmentation, count: int = 400) -> list[Change]:
    return [draw_change(strengths, np.random.default_rng(seed)) for seed in range(count)]


def is_changed(change: Change) -> set[str]:
    tests = {
        "scale": change.scale != 1,
        "depth": change.depth != 1,
        "flip": change.is_flipped,
        "jitter": change.shift != (0, 0),
        "aspect": change.aspect != 1,
        "cover": change.cover is not None,
        "rotation_rad": change.rotation_rad != 0,
        "line_shift_px": change.line_shifts_px is not None,
        "reflectance": change.reflectance != 1,
    }
    return {name for name, is_so in tests.items() if is_so}


def test_nothing_is_changed_where_all_is_off():
    assert all(not is_changed(change) for change in drawn(Augmentation.none(), 50))


@pytest.mark.parametrize("operation", OPERATIONS)
def test_one_operation_alone(operation: str):
    changed = [is_changed(change) for change in drawn(Augmentation().only(operation), 50)]
    assert set().union(*changed) == {operation}


def test_draws_spread_over_their_strength_and_not_beyond():
    strengths = Augmentation(scale=0.2, depth=0.5, jitter=0.1, cover=0.3, rotation_rad=0.05)
    changes = drawn(strengths)
    scales, depths = np.array([(c.scale, c.depth) for c in changes]).T
    assert 1 / 1.2 <= scales.min() < 0.85
    assert 1.18 < scales.max() <= 1.2
    assert abs(np.log(depths).mean()) < 0.03  # as often nearer as farther
    assert np.abs([c.shift for c in changes]).max() == pytest.approx(0.1, abs=0.002)
    assert np.abs([c.rotation_rad for c in changes]).max() == pytest.approx(0.05, abs=0.001)
    shares = [c.cover.share for c in changes if c.cover]
    assert 0.29 < max(shares) <= 0.3
    assert len(shares) / len(changes) == pytest.approx(0.5, abs=0.1)
    assert np.mean([c.is_flipped for c in changes]) == pytest.approx(0.5, abs=0.1)


def test_the_same_seed_draws_the_same():
    first, second = (draw_change(Augmentation(), np.random.default_rng([1, 2])) for _ in range(2))
    assert (first.scale, first.cover, first.shift) == (second.scale, second.cover, second.shift)
    np.testing.assert_array_equal(first.line_shifts_px, second.line_shifts_px)


def test_switching_one_off_leaves_the_others_as_drawn():
    whole = draw_change(Augmentation(), np.random.default_rng(5))
    part = draw_change(Augmentation(scale=0.0, cover=0.0), np.random.default_rng(5))
    assert (part.scale, part.cover) == (1.0, None)
    assert (part.depth, part.aspect, part.shift) == (whole.depth, whole.aspect, whole.shift)


@pytest.mark.parametrize(("name", "strength"), [("scale", -0.1), ("cover", 1.0), ("flip", 2.0)])
def test_strengths_that_cannot_be_are_refused(name: str, strength: float):
    with pytest.raises(UsageError, match=f"augmentation {name}: expected a strength from 0 to"):
        Augmentation(**{name: strength})
