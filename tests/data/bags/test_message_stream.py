"""Messages found by their number in time, in every format."""

from pathlib import Path

import numpy as np
import pytest

from data.bags.bag import Bag
from data.bags.message_stream import MessageStream
from data.bags.message_times import read_times
from tests.bag_writer import FIRST_NS, KINDS, BagWriter, columns_of

# Stamp and time of recording in ms: two recorded at once, one late, one before its time.
MESSAGES = [(0, 1), (10, 12), (20, 12), (40, 41), (30, 45), (50, 51)]


def stream_of(folder: Path, kind: str) -> MessageStream:
    """Return a stream of clouds whose first x is the number of the message by its stamp."""
    with BagWriter(folder, kind) as writer:
        for stamp_ms, received_ms in MESSAGES:
            columns = columns_of(np.full((3, 4), stamp_ms / 10, np.float32))
            message = writer.cloud_message(FIRST_NS + stamp_ms * 1_000_000, columns)
            writer.write("/points", message, FIRST_NS + received_ms * 1_000_000)
            writer.transforms(FIRST_NS + received_ms * 1_000_000, {("a", "b"): np.eye(4)}, "/tf")
    bag = Bag(writer.path)
    return MessageStream(bag, "/points", read_times(bag, ("/points",), {})["/points"])


def first_x(stream: MessageStream, index: int) -> float:
    return float(stream.read(index).data[:4].view(np.float32)[0])


@pytest.mark.parametrize("kind", KINDS)
def test_messages_are_found_in_any_order(tmp_path: Path, kind: str) -> None:
    stream = stream_of(tmp_path / "bag", kind)
    assert (stream.times.stamps_ns - FIRST_NS).tolist() == [k * 10_000_000 for k in range(6)]
    for order in (range(6), range(5, -1, -1), (3, 3, 1, 2, 0, 5, 4)):
        assert [first_x(stream, index) for index in order] == list(order)


def test_a_topic_is_moved_to_the_clock_of_another(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as writer:
        for index in range(4):
            now_ns = FIRST_NS + index * 100_000_000
            cloud = columns_of(np.ones((1, 4), np.float32))
            writer.write("/unix", writer.cloud_message(now_ns, cloud), now_ns + 5_000_000)
            since_start_ns = 7_000_000_000 + index * 100_000_000
            writer.write("/boot", writer.cloud_message(since_start_ns, cloud), now_ns + 6_000_000)
            writer.write("/none", writer.cloud_message(0, cloud), now_ns)
    times = read_times(Bag(writer.path), ("/unix", "/boot", "/none"), {})
    assert times["/unix"].by_clock_of(times["/unix"]) is times["/unix"]
    moved = times["/boot"].by_clock_of(times["/unix"])
    assert np.array_equal(moved.stamps_ns, times["/unix"].stamps_ns + 1_000_000)
    assert np.array_equal(times["/none"].stamps_ns, times["/none"].received_ns)


def test_a_stream_is_opened_again_in_another_process(tmp_path: Path) -> None:
    import pickle

    stream = stream_of(tmp_path / "bag", "mcap")
    assert first_x(stream, 2) == 2
    assert first_x(pickle.loads(pickle.dumps(stream)), 4) == 4


def test_big_endian_headers_are_read() -> None:
    from data.bags.bag import RawMessage
    from data.bags.message_times import header_stamp_ns

    data = bytes.fromhex("00000000 0000000c 00000007")
    assert header_stamp_ns(RawMessage("/points", 0, data), is_ros1=False) == 12_000_000_007
