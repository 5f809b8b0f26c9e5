"""A drive as a live source."""

import time
from dataclasses import dataclass
from pathlib import Path

import pytest

from data.live.source import PacedDrive
from data.open_drive import open_drive
from perception.errors import ScanError
from perception.sensor import VLP_16
from tests.car_frames import write_car_frames_with_a_gap


@dataclass(frozen=True)
class Moment:
    stamp_s: float


class Ticking:
    """A drive of frames that are their stamps; reading one takes a while."""

    name, sensor, is_sequence = "ticking", VLP_16, True

    def __init__(self, stamps_s, reading_s=0.0, damaged=()):
        self.stamps_s, self.reading_s, self.damaged, self.read = stamps_s, reading_s, damaged, []

    def __len__(self):
        return len(self.stamps_s)

    def stamp_s(self, index):
        return self.stamps_s[index]

    def __getitem__(self, index):
        time.sleep(self.reading_s)
        self.read.append(index)
        if index in self.damaged:
            raise ScanError(f"{index}.bin", expected="points", found="none")
        return Moment(self.stamps_s[index])


def frames_of(source: PacedDrive) -> list[float]:
    (lap,) = source.laps()
    return [frame.stamp_s for frame in lap]


def test_frames_come_at_their_times():
    source, start_s = PacedDrive(Ticking([5.0, 5.1, 5.2, 5.3]), rate=2.0), time.perf_counter()
    (lap,) = source.laps()
    times_s = [time.perf_counter() - start_s for _ in lap]
    for found_s, due_s in zip(times_s, (0, 0.05, 0.1, 0.15), strict=True):
        assert due_s - 0.005 <= found_s < due_s + 0.1
    assert source.dropped == 0


def test_frames_whose_time_is_over_are_not_read():
    drive = Ticking([0.1 * index for index in range(30)], reading_s=0.025)
    source = PacedDrive(drive, rate=10.0)  # a frame each 10 ms
    stamps_s = frames_of(source)
    assert len(stamps_s) + source.dropped == 30
    assert source.dropped >= 10
    assert len(drive.read) == len(stamps_s)
    assert stamps_s == sorted(stamps_s)


def test_a_break_of_the_recording_is_not_waited_for():
    start_s = time.perf_counter()
    assert frames_of(PacedDrive(Ticking([0.0, 3600.0, 3600.1]))) == [0.0, 3600.0, 3600.1]
    assert time.perf_counter() - start_s < 2


def test_a_damaged_frame_is_left_out(caplog):
    assert frames_of(PacedDrive(Ticking([0.0, 0.1, 0.2], damaged=[1]), rate=50)) == [0.0, 0.2]
    assert "skipped frame 1: 1.bin: expected points" in caplog.text


def test_an_endless_drive_begins_again_at_later_times():
    source = PacedDrive(Ticking([5.0, 5.1]), rate=50, is_endless=True)
    laps = source.laps()
    found = [[frame.stamp_s for frame in next(laps)] for _ in range(3)]
    assert found == [pytest.approx([5.0 + offset, 5.1 + offset]) for offset in (0, 0.2, 0.4)]
    source.close()
    assert list(next(laps, [])) == []


def test_a_closed_source_ends_within_a_wait():
    source = PacedDrive(Ticking([0.0, 0.9, 1.8, 2.7]))
    (lap,) = source.laps()
    next(lap)
    source.close()
    start_s = time.perf_counter()
    list(lap)
    assert time.perf_counter() - start_s < 0.5


def test_frames_without_times_come_at_the_rate_of_the_sensor(tmp_path: Path):
    drive = open_drive(write_car_frames_with_a_gap(tmp_path / "cars"))
    source = PacedDrive(drive, rate=20.0)
    assert not source.is_sequence
    (lap,) = source.laps()
    assert [frame.index for frame in lap] == [0, 1, 2]
