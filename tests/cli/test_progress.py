"""A bar that changes nothing of what goes through it."""

from perception.cli.progress import frame_progress_bar, progress_bar


def test_all_steps_come_through_in_order_and_are_counted(capsys):
    assert list(progress_bar("abc", "letters", 3, unit="letter")) == ["a", "b", "c"]
    written = capsys.readouterr().err
    assert written.startswith("\rletters:   0%")
    assert "3/3" in written


def test_short_work_on_frames_shows_nothing(capsys):
    assert list(frame_progress_bar("pictures")(range(4))) == [0, 1, 2, 3]
    assert capsys.readouterr().err == ""
