"""An object in another process: called as one of this process, and its errors come here."""

import os
from collections import Counter
from contextlib import closing
from functools import partial

from perception.errors import PerceptionError
from perception.pipeline.remote_object import RemoteObject
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


def test_a_closed_one_says_so():
    remote = RemoteObject("the list", list, "use a list here")
    remote.close()
    with fault(PerceptionError, "process of the list", "until it is closed", "exit code 0"):
        remote.call(list.__len__)
