"""A domain of DDS for each test."""

import os
import random
from collections.abc import Iterator

import pytest


@pytest.fixture
def domain(monkeypatch) -> Iterator[int]:
    """Name a domain of this test alone."""
    number = 100 + (os.getpid() + random.randrange(100)) % 100
    monkeypatch.setenv("ROS_DOMAIN_ID", str(number))
    monkeypatch.delenv("CYCLONEDDS_URI", raising=False)
    return number
