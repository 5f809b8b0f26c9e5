"""A viewer that speaks Foxglove's protocol, by hand: what it receives are texts of JSON, and messages behind 13 bytes."""

import json
import struct
import time
from contextlib import ExitStack
from typing import Any

from websockets.sync.client import connect

from data.messages.definitions import typestore

PROTOCOL = "foxglove.sdk.v1"


class Viewer:
    """Subscribes to topics; a context manager."""

    def __init__(self, address: str, *topics: str) -> None:
        """Connect; all topics where none is named."""
        self._stack = ExitStack()
        self._socket = self._stack.enter_context(
            connect(address, subprotocols=[PROTOCOL], max_size=None)
        )
        self._names = topics
        self.server_info: dict[str, Any] = {}
        self.channels: dict[int, dict[str, Any]] = {}

    def __enter__(self) -> "Viewer":
        return self

    def __exit__(self, *error: object) -> None:
        self._stack.close()

    def receive(self, timeout_s: float = 10.0) -> tuple[str, int, Any]:
        """Return topic, time in nanoseconds and message of the next message."""
        end_s = time.monotonic() + timeout_s
        while True:
            data = self._socket.recv(max(end_s - time.monotonic(), 0))
            if isinstance(data, str):
                self._take(json.loads(data))
                continue
            operation, subscription, stamp_ns = struct.unpack_from("<BIQ", data)
            assert operation == 1
            channel = self.channels[subscription]
            value = typestore().deserialize_cdr(data[13:], channel["schemaName"])
            return channel["topic"], stamp_ns, value

    def take_texts(self, timeout_s: float) -> None:
        """Read what the server says before it sends messages."""
        try:
            while True:
                self._take(json.loads(self._socket.recv(timeout_s)))
        except TimeoutError:
            return

    def _take(self, text: dict[str, Any]) -> None:
        if text["op"] == "serverInfo":
            self.server_info = text
        if text["op"] == "advertise":
            asked = [
                one for one in text["channels"] if one["topic"] in self._names or not self._names
            ]
            self.channels |= {one["id"]: one for one in asked}
            rows = [{"id": one["id"], "channelId": one["id"]} for one in asked]
            self._socket.send(json.dumps({"op": "subscribe", "subscriptions": rows}))
