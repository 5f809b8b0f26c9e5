"""What no command takes is refused in the same words."""

import pytest

from perception.cli.flags import require_positive
from perception.cli.parser import parse
from perception.cli.split import split
from perception.errors import UsageError


@pytest.mark.parametrize("count", [0, -3])
def test_no_count_below_one(count):
    with pytest.raises(UsageError) as caught:
        require_positive("--frames", count)
    error = caught.value
    assert (error.where, error.expected, error.found) == ("--frames", "at least 1", str(count))


@pytest.mark.parametrize("count", [1, None])
def test_one_is_enough_and_none_is_no_limit(count):
    require_positive("--frames", count)


def test_no_drive_is_refused(tmp_path):
    path = tmp_path / "config.yaml"
    path.write_text("roots: []\nout: split.json\n")
    with pytest.raises(UsageError) as caught:
        parse("trifuse split", split, ["--config", str(path)])
    assert (caught.value.where, caught.value.found) == ("ROOTS", "none")
