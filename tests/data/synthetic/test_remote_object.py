"""An object in another process: called as one of this process, and its errors come here."""

import os
import signal
from collections import Counter
from contextlib import closing
from functools import partial

import pytest

from data.synthetic.remote_object import RemoteObject
from perception.errors import PerceptionError
from tests.faults import fault


def test_it_remembers_what_earlier_calls_did():
    with closing(RemoteObject("the counter", partial(Counter, "abba"), "count here")) as remote:
        remote.call(Counter.update, "ac")
        assert remote.call(Counter.most_common, 1) == [("a", 3)]
        assert remote.process_id != os.getpid()


def test_errors_come_here_and_it_goes_on():
    with closing(RemoteObject("the list", list, "use a list here")) as remote:
        try:
            remote.call(list.remove, 1)
        except ValueError as error:
            assert "not in list" in str(error)
        assert remote.call(list.__len__) == 0


def test_what_stops_all_processes_is_left_to_the_one_that_started_it():
    with closing(RemoteObject("the list", list, "use a list here")) as remote:
        remote.call(list.append, 1)
        for stop in (signal.SIGINT, signal.SIGTERM):
            os.kill(remote.process_id, stop)
        assert remote.call(list.__len__) == 1


def test_modules_in_the_working_folder_are_not_imported(monkeypatch, tmp_path):
    (tmp_path / "perception").mkdir()
    for name in ("perception/__init__", "random", "types", "numpy"):
        (tmp_path / f"{name}.py").write_text("raise RuntimeError('a file of the user')\n")
    monkeypatch.chdir(tmp_path)
    with closing(RemoteObject("the list", list, "use a list here")) as remote:
        assert remote.call(list.__len__) == 0


def test_one_that_was_killed_says_so():
    remote = RemoteObject("the list", list, "use a list here")
    remote.call(list.__len__)
    os.kill(remote.process_id, signal.SIGKILL)
    with fault(PerceptionError, "process of the list", "until it is closed", "exit code -9"):
        remote.call(list.__len__)
    remote.close()


def test_without_a_python_to_start_it_says_what_to_do(monkeypatch, tmp_path):
    monkeypatch.setattr("sys.executable", str(tmp_path / "python"))
    with pytest.raises(PerceptionError) as error:
        RemoteObject("the list", list, "use a list here")
    assert error.value.where == f"process of {tmp_path / 'python'}"
    assert error.value.advice == "use a list here"


def test_a_closed_one_has_ended_and_says_so():
    remote = RemoteObject("the list", list, "use a list here")
    remote.close()
    with pytest.raises(ProcessLookupError):
        os.kill(remote.process_id, 0)
    with fault(PerceptionError, "process of the list", "until it is closed", "exit code 0"):
        remote.call(list.__len__)
