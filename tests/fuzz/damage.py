"""Damaged files: valid ones with a few edits, as hypothesis draws and shrinks them."""

from collections.abc import Sequence

from hypothesis import strategies as st

# What breaks parsers: numbers at the ends of their types, letters of other alphabets, brackets that never close.
WORDS: tuple[bytes, ...] = (
    b"", b"nan", b"-inf", b"1e999", b"-1", b"0", b"1e-320", b"4294967296", b"9" * 30, b"\x00", b"\xff\xfe", b"\n",
    b"\r", b" ", b",", b":", b"- ", b"&a [*a]", b"!!python/name:os.system", b"[" * 200, b"{", b'"', "é٣".encode(),
    b"\x7f\xff\xff\xff", b"\xff\xff\xff\xff\xff\xff\xff\x7f", b"../../etc/passwd", b"null", b"true",
)  # fmt: skip


@st.composite
def damaged(draw: st.DrawFn, seeds: Sequence[bytes]) -> bytes:
    """Draw a valid file with one to four edits: a piece is cut out, repeated, or replaced."""
    data = draw(st.sampled_from(seeds))
    for _ in range(draw(st.integers(1, 4))):
        start = draw(st.integers(0, len(data)))
        length = draw(st.sampled_from((0, 1, 2, 4, 8, 64, len(data))))
        piece = data[start : start + length]
        new = draw(st.sampled_from(WORDS) | st.binary(max_size=8) | st.just(piece * 2))
        data = data[:start] + new + data[start + length :]
    return data
