"""Processes of a robot beside the tests, and what they have received."""

import base64
import json
import os
import subprocess
import sys
import threading
from collections import defaultdict
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from data.messages.definitions import typestore

ROBOT = Path(__file__).with_name("robot.py")


class Listener:
    """Binary forms of the messages that a process prints, by topic."""

    def __init__(self, process: subprocess.Popen, kinds: Mapping[str, str]) -> None:
        self.received: dict[str, list[bytes]] = defaultdict(list)
        self._kinds, self._process = kinds, process
        self.changed = threading.Condition()
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()

    def wait_for(self, topic: str, count: int = 1, timeout_s: float = 30.0) -> list[bytes]:
        """Return the messages of a topic when there are so many."""
        with self.changed:
            enough = self.changed.wait_for(lambda: len(self.received[topic]) >= count, timeout_s)
        assert enough, f"{len(self.received[topic])} of {count} messages of {topic}"
        return self.received[topic]

    def decoded(self, topic: str) -> list:
        """Return the messages of a topic as rosbags decodes them."""
        kind = self._kinds[topic]
        return [typestore().deserialize_cdr(one, kind) for one in self.received[topic]]

    def order(self) -> None:
        """Let it go on."""
        self._process.stdin.write("go on\n")
        self._process.stdin.flush()

    def wait_for_end(self) -> None:
        self._process.wait(60)
        self._thread.join(10)

    def _read(self) -> None:
        for text in self._process.stdout:
            line = json.loads(text)
            with self.changed:
                self.received[line["topic"]].append(base64.b64decode(line["cdr"]))
                self.changed.notify_all()


@contextmanager
def robot(domain: int, kinds: Mapping[str, str], drive: Path | None = None) -> Iterator[Listener]:
    """Run a robot that listens to topics, and publishes a drive where there is one."""
    words = [word for name, kind in kinds.items() for word in (name, kind.rpartition("/")[2])]
    process = subprocess.Popen(
        [sys.executable, "-P", str(ROBOT), str(domain), str(drive or "-"), *words],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=os.environ, text=True,
    )  # fmt: skip
    try:
        yield Listener(process, kinds)
    finally:
        process.kill()
        process.wait()
