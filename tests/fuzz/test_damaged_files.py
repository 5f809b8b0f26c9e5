"""Every parser reads a damaged file or refuses it in one sentence, in the memory that a whole file may need.

`make fuzz` looks longer, led by the lines of the parsers that it has not yet reached.
"""

import signal
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.fuzz.damage import damaged
from tests.fuzz.parsers import PARSERS
from tests.fuzz.refusal import memory_bound, place, refusal

FILES_A_PARSER = 40
MAX_SECONDS = 30  # of one file, on a machine that does other things, too
MAX_BYTES = 512 << 20


@pytest.fixture(autouse=True)
def _alarm():
    """End a parser that hangs."""

    def late(*_: object) -> None:
        raise TimeoutError(f"a parser took longer than {MAX_SECONDS} s for one file")

    before = signal.signal(signal.SIGALRM, late)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


@pytest.mark.parametrize("name", PARSERS)
def test_valid_files_are_read(name, tmp_path):
    parser = PARSERS[name]
    path = place(parser, tmp_path)
    assert [refusal(parser, path, seed) for seed in parser.seeds()] == [None] * len(parser.seeds())


@pytest.mark.parametrize("name", PARSERS)
def test_damaged_files_are_read_or_refused_in_a_sentence(name):
    parser = PARSERS[name]
    seeds = parser.seeds()

    @settings(
        max_examples=FILES_A_PARSER,
        derandomize=True,
        database=None,
        deadline=None,
        suppress_health_check=list(HealthCheck),
    )
    @given(data=damaged(seeds))
    def read(data: bytes) -> None:
        signal.alarm(MAX_SECONDS)
        with TemporaryDirectory() as folder:
            refusal(parser, place(parser, Path(folder)), data)

    with memory_bound(MAX_BYTES):
        read()


@pytest.mark.parametrize("name", PARSERS)
@settings(max_examples=20, derandomize=True, database=None, deadline=None)
@given(data=st.binary(max_size=256))
def test_other_bytes_are_read_or_refused_in_a_sentence(name, data):
    with TemporaryDirectory() as folder:
        refusal(PARSERS[name], place(PARSERS[name], Path(folder)), data)
