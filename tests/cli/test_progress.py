"""What commands share: refused counts, and a bar that changes nothing of what goes through it."""

import pytest

from perception.cli.flags import require_positive
from perception.cli.progress import bar, frame_bar
from perception.errors import UsageError


@pytest.mark.parametrize("count", [0, -3])
def test_no_count_below_one(count):
    with pytest.raises(UsageError, match=f"--frames: expected at least 1, found {count}"):
        require_positive("--frames", count)


@pytest.mark.parametrize("count", [1, None])
def test_one_is_enough_and_none_is_no_limit(count):
    require_positive("--frames", count)


def test_all_steps_come_through_in_order_and_are_counted(capsys):
    assert list(bar("abc", "letters", 3, unit="letter")) == ["a", "b", "c"]
    written = capsys.readouterr().err
    assert written.startswith("\rletters:   0%")
    assert "3/3" in written


def test_short_work_on_frames_shows_nothing(capsys):
    assert list(frame_bar("pictures")(range(4))) == [0, 1, 2, 3]
    assert capsys.readouterr().err == ""
