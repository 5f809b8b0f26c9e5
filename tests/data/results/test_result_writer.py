"""Writers are closed in any case, and know whether the run was complete."""

import pytest

from data.results.result_writer import ResultWriter, open_writers
from data.results.run_writers import BackgroundWriter


class Log(ResultWriter):
    """Notes its calls in a list that writers share; fails at one of the results."""

    def __init__(self, name, calls, fails_at=None):
        self.name, self.calls, self.fails_at = name, calls, fails_at

    def add(self, result, selected):
        if result == self.fails_at:
            raise OSError(self.name)
        self.calls.append((self.name, result))

    def close(self, *, is_complete):
        self.calls.append((self.name, is_complete))


def write(writers, results):
    with open_writers(writers) as opened:
        for result in results:
            for writer in opened:
                writer.add(result, None)


def test_the_first_writer_is_closed_last():
    calls = []
    write([Log("a", calls), Log("b", calls)], [1, 2])
    assert calls == [("a", 1), ("b", 1), ("a", 2), ("b", 2), ("b", True), ("a", True)]


def test_all_are_closed_where_one_fails():
    calls = []
    with pytest.raises(OSError, match="b"):
        write([Log("a", calls), Log("b", calls, fails_at=2)], [1, 2])
    assert calls[3:] == [("b", False), ("a", False)]


def test_those_before_one_that_cannot_be_made_are_closed():
    calls = []

    def writers():
        yield Log("a", calls)
        raise OSError

    with pytest.raises(OSError):
        write(writers(), [1])
    assert calls == [("a", False)]


def test_a_writer_in_the_background_gets_every_result_in_order():
    calls = []
    write([BackgroundWriter(Log("a", calls), "test")], range(9))
    assert calls == [*(("a", result) for result in range(9)), ("a", True)]


def test_an_error_in_the_background_ends_the_run():
    calls = []
    with pytest.raises(OSError, match="a"):
        write([BackgroundWriter(Log("a", calls, fails_at=1), "test")], range(9))
    assert (calls[0], calls[-1]) == (("a", 0), ("a", False))


def test_an_error_at_the_last_result_is_raised_too():
    calls = []
    with pytest.raises(OSError, match="a"):
        write([BackgroundWriter(Log("a", calls, fails_at=8), "test")], range(9))
    assert calls[-1] == ("a", False)
