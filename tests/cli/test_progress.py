"""A bar that changes nothing of what goes through it."""

import sys

from perception.cli.progress import close_bars, frame_progress_bar, progress_bar, write_line


def test_all_steps_come_through_in_order_and_are_counted(capsys):
    assert list(progress_bar("abc", "letters", 3, unit="letter")) == ["a", "b", "c"]
    written = capsys.readouterr().err
    assert written.startswith("\rletters:   0%")
    assert "3/3" in written


def test_short_work_on_frames_shows_no_bar(capsys):
    assert list(frame_progress_bar("pictures")(range(4))) == [0, 1, 2, 3]
    assert capsys.readouterr().err == ""


def test_an_error_starts_on_a_line_of_its_own(capsys):
    steps = progress_bar(range(3), "frames")
    next(iter(steps))
    close_bars()
    print("trifuse run: sentence", file=sys.stderr)
    lines = capsys.readouterr().err.split("\n")
    assert lines[-2:] == ["trifuse run: sentence", ""]
    assert lines[-3].startswith("\rframes:")


def test_a_line_is_written_above_the_bars(capsys):
    for step in progress_bar(range(2), "frames"):
        write_line(f"skipped frame {step}")
    written = capsys.readouterr().err
    for step in range(2):
        before, after = written.split(f"skipped frame {step}")
        # Nothing is left of the bar on the line: it was cleared, or the line is new.
        assert before.rpartition("\r")[2].strip() == ""
        assert after.startswith("\n")
