"""Packages add layouts by entry points; a broken one stops none of the others."""

import logging
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

from data import layout_registry
from data.layouts import Layout, OpenConfig
from data.open_drive import open_drive, sequences_in
from perception.errors import DriveError
from tests.faults import fault

SEEN: list[tuple[str | None, OpenConfig]] = []


def _open(path: Path, sequence: str | None, config: OpenConfig):
    SEEN.append((sequence, config))
    (folder,) = path.glob("*.recorder")
    return open_drive(folder / (sequence or ""), config=config)


def _sequences(path: Path) -> tuple[str, ...] | None:
    (folder, *_), found = [*path.glob("*.recorder"), path], None
    if folder != path:
        found = tuple(sorted(one.name for one in folder.iterdir()))
    return found


RECORDER = Layout("My recorder", "a folder of my recorder (*.recorder)", _sequences, _open)


@pytest.fixture
def installed(monkeypatch):
    """Return a function that installs entry points for the time of a test."""

    def install(*names: str) -> None:
        entries = [EntryPoint(name, f"{__name__}:{name}", "trifuse.layouts") for name in names]
        loaded = {"RECORDER": RECORDER, "NUMBER": 3}

        def load(entry: EntryPoint):
            return loaded[entry.name]

        monkeypatch.setattr(EntryPoint, "load", load)
        monkeypatch.setattr(layout_registry, "entry_points", lambda group: entries)
        layout_registry._installed_layouts.cache_clear()

    yield install
    layout_registry._installed_layouts.cache_clear()


def test_a_drive_of_an_installed_layout_is_opened(installed, raw_drive):
    installed("RECORDER")
    root = raw_drive.parent.parent / "mine"
    (root / "a.recorder").mkdir(parents=True)
    for name in ("first", "second"):
        (root / "a.recorder" / name).symlink_to(raw_drive)
    assert sequences_in(root) == ["first", "second"]
    config = OpenConfig(sensor="HDL-32E")
    drive = open_drive(root, sequence="second", images=False, config=config)
    assert (len(drive), drive.has_images, drive.sensor.name) == (6, False, "HDL-32E")
    assert SEEN[-1] == ("second", OpenConfig(sensor="HDL-32E", images=False))


def test_broken_layouts_are_left_out(installed, tmp_path, caplog):
    installed("NUMBER", "MISSING", "RECORDER")
    with caplog.at_level(logging.WARNING), fault(DriveError, expected="my recorder (*.recorder)"):
        open_drive(tmp_path)
    number, missing = caplog.messages
    assert number.endswith(":NUMBER) is left out: it names a int, not a Layout")
    assert missing.endswith(":MISSING) is left out: 'MISSING'")


def test_packages_are_not_asked_where_a_layout_of_ours_fits(raw_drive, monkeypatch):
    def refuse(group: str):
        raise AssertionError(group)

    layout_registry._installed_layouts.cache_clear()
    monkeypatch.setattr(layout_registry, "entry_points", refuse)
    assert len(open_drive(raw_drive)) == 6
