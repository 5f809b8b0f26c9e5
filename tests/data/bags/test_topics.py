"""Which topics become the parts of a drive."""

import pytest

from data.bags.bag import RawMessage
from data.bags.topics import choose_topics
from data.dds.recent_bag import RecentBag
from perception.errors import UsageError

KINDS = {
    "/points": "sensor_msgs/msg/PointCloud2",
    "/wheels": "nav_msgs/msg/Odometry",
    "/filtered": "nav_msgs/msg/Odometry",
}


def test_odometry_is_named_or_the_longest():
    counts = {"/points": 3, "/wheels": 5, "/filtered": 4}
    rows = {name: [RawMessage(name, 0, b"")] * count for name, count in counts.items()}
    bag = RecentBag("robot", KINDS, rows)
    chosen = choose_topics(bag)
    assert chosen.odometry == "/wheels"
    assert chosen.notes == (
        "robot/topics: poses of /wheels among /filtered, /wheels; others with --odometry",
    )
    named = choose_topics(bag, poses="filtered")
    assert (named.odometry, named.notes) == ("/filtered", ())
    with pytest.raises(UsageError, match="--odometry gps: expected topics of robot/topics: /filtered, /wheels"):  # fmt: skip
        choose_topics(bag, poses="gps")
