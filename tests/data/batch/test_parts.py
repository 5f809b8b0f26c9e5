"""Parts in this process and in several: the same results, errors as sentences, and processes that die replaced."""

import os
import signal
from pathlib import Path

import pytest

from data.batch.parts import run_parts
from perception.errors import PerceptionError, UsageError
from tests.faults import fault


def double(number: int) -> tuple[int, int]:
    return 2 * number, os.getpid()


def die_once(mark: Path) -> str:
    """End this process at the first try."""
    if mark.exists():
        return mark.name
    mark.touch()
    os.kill(os.getpid(), signal.SIGKILL)
    raise AssertionError("this process is dead")


def die(_: int) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


@pytest.mark.parametrize("workers", [1, 2])
def test_every_part_is_done_by_as_many_processes(workers):
    done = dict(run_parts(double, range(6), workers))
    assert {part: twice for part, (twice, _) in done.items()} == {n: 2 * n for n in range(6)}
    processes = {process for _, process in done.values()}
    assert (os.getpid() in processes) == (workers == 1)
    assert len(processes) <= workers


def test_a_process_that_dies_is_replaced(tmp_path):
    marks = [tmp_path / name for name in "ab"]
    assert sorted(name for _, name in run_parts(die_once, marks, 2)) == ["a", "b"]


def test_a_part_that_ends_every_process_is_an_error(monkeypatch):
    monkeypatch.setattr("data.batch.cluster._ALLOWED_DEATHS", 0)
    with fault(PerceptionError, found="ended from outside"):
        list(run_parts(die, [1, 2], 2))


def test_no_worker_is_refused():
    with fault(UsageError, expected="at least 1", found="0"):
        list(run_parts(double, [1], workers=0))
