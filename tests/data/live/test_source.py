"""A drive as a live source, by a clock that moves only where somebody waits or reads."""

from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

import pytest

from data.live import source as live_source
from data.live.source import PacedDrive
from data.open_drive import open_drive
from perception.errors import ScanError
from perception.sensor import VLP_16
from tests.car_frames import write_car_frames_with_a_gap


class Clock:
    """Time, and events that are waited for."""

    def __init__(self) -> None:
        self.now_s, self.is_closed = 1000.0, False

    def perf_counter(self) -> float:
        return self.now_s

    def wait(self, seconds: float) -> bool:
        self.now_s += 0 if self.is_closed else seconds
        return self.is_closed

    def is_set(self) -> bool:
        return self.is_closed

    def set(self) -> None:
        self.is_closed = True


@pytest.fixture
def clock(monkeypatch) -> Clock:
    clock = Clock()
    monkeypatch.setattr(live_source, "time", clock)
    monkeypatch.setattr(live_source, "threading", SimpleNamespace(Event=lambda: clock))
    return clock


@dataclass(frozen=True)
class Moment:
    stamp_s: float


class Ticking:
    """A drive of frames that are their stamps; reading one takes a while."""

    name, sensor, is_sequence = "ticking", VLP_16, True

    def __init__(self, clock, stamps_s, reading_s=0.0, damaged=()):
        self.clock, self.stamps_s, self.reading_s, self.damaged = (
            clock,
            stamps_s,
            reading_s,
            damaged,
        )
        self.read = []

    def __len__(self):
        return len(self.stamps_s)

    def stamp_s(self, index):
        return self.stamps_s[index]

    def __getitem__(self, index):
        self.clock.now_s += self.reading_s
        self.read.append(index)
        if index in self.damaged:
            raise ScanError(f"{index}.bin", expected="points", found="none")
        return Moment(self.stamps_s[index])


def frames_of(source: PacedDrive) -> list[float]:
    (lap,) = source.laps()
    return [frame.stamp_s for frame in lap]


def test_frames_come_at_their_times(clock):
    drive = Ticking(clock, [5.0, 5.1, 5.2, 5.4], reading_s=0.01)
    source = PacedDrive(drive, rate=2.0)
    (lap,) = source.laps()
    times_s = [clock.now_s - 1000 for _ in lap]
    # The first one comes when it is read.
    assert times_s == pytest.approx([0.01, 0.05, 0.1, 0.2])
    assert source.dropped == 0


def test_frames_whose_time_is_over_are_not_read(clock):
    drive = Ticking(clock, [0.1 * index for index in range(30)], reading_s=0.25)
    source = PacedDrive(drive)
    stamps_s = frames_of(source)
    assert len(stamps_s) + source.dropped == 30
    assert len(drive.read) == len(stamps_s)
    assert stamps_s == sorted(stamps_s)
    assert len(stamps_s) == pytest.approx(30 * 0.1 / 0.25, abs=2)
    assert clock.now_s - 1000 == pytest.approx(3.0, abs=0.3)  # no later than the recording


def test_a_break_of_the_recording_is_not_waited_for(clock):
    assert frames_of(PacedDrive(Ticking(clock, [0.0, 3600.0, 3600.1]))) == [0.0, 3600.0, 3600.1]
    assert clock.now_s - 1000 == pytest.approx(0.2)


def test_a_damaged_frame_is_left_out(clock, caplog):
    assert frames_of(PacedDrive(Ticking(clock, [0.0, 0.1, 0.2], damaged=[1]))) == [0.0, 0.2]
    assert "skipped frame 1: 1.bin: expected points" in caplog.text


def test_an_endless_drive_begins_again_at_later_times(clock):
    source = PacedDrive(Ticking(clock, [5.0, 5.1]), is_endless=True)
    laps = source.laps()
    found = [[frame.stamp_s for frame in next(laps)] for _ in range(3)]
    assert found == [pytest.approx([5.0 + offset, 5.1 + offset]) for offset in (0, 0.2, 0.4)]
    source.close()
    assert list(next(laps, [])) == []


def test_a_closed_source_ends_within_a_wait(clock):
    source = PacedDrive(Ticking(clock, [0.0, 0.9, 1.8, 2.7]))
    (lap,) = source.laps()
    next(lap)
    source.close()
    list(lap)
    assert clock.now_s == 1000


def test_frames_without_times_come_at_the_rate_of_the_sensor(clock, tmp_path: Path):
    drive = open_drive(write_car_frames_with_a_gap(tmp_path / "cars"))
    source = PacedDrive(drive)
    assert not source.is_sequence
    (lap,) = source.laps()
    times_s = [(frame.index, clock.now_s - 1000) for frame in lap]
    assert times_s == [(0, 0), (1, pytest.approx(0.1)), (2, pytest.approx(0.2))]
