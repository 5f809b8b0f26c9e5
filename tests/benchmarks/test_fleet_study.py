"""What the study of many drives measures; the batches themselves are tested with `trifuse batch`."""

import pytest

from benchmarks.studies.fleet import FleetConfig, FleetRun, _content, _Killer, fleet
from perception.errors import DriveError
from tests.car_frames import write_car_frames
from tests.faults import fault


def test_the_rate_leaves_out_the_first_and_the_last_tenth():
    starting, steady, ending = [9.0], [10.0, 12.0, 14.0, 16.0, 18.0, 20.0, 22.0, 24.0], [40.0]
    run = FleetRun(40.0, starting + steady + ending, {})
    assert run.rate_per_s == pytest.approx(8 / 15)  # of the drives from 9 s to 24 s


def test_content_is_that_of_the_results_and_not_of_the_times(tmp_path):
    for name, poses, times in (("a", "1", "7"), ("b", "1", "8"), ("c", "2", "7")):
        folder = tmp_path / "drives" / name
        folder.mkdir(parents=True)
        (folder / "poses.txt").write_text(poses)
        (folder / "summary.json").write_text(times)
    content = _content(tmp_path)
    assert content["a"] == content["b"] != content["c"]


class Process:
    """A process that remembers who was killed."""

    def __init__(self, killed: list[str], name: str) -> None:
        self.killed, self.name = killed, name

    def children(self) -> list["Process"]:
        return [Process(self.killed, "worker")] if self.name == "scheduler" else []

    def cmdline(self) -> list[str]:
        return ["python", "spawn_main"]

    def kill(self) -> None:
        self.killed.append(self.name)


def test_one_process_dies_after_each_drive_the_scheduler_in_the_middle(monkeypatch):
    monkeypatch.setattr("benchmarks.studies.fleet.time.sleep", lambda _: None)
    killed: list[str] = []
    killer = _Killer(FleetConfig(deaths=3))
    for done in (0, 1, 1, 2, 3, 4, 5, 6):
        killer.kill_next(Process(killed, "scheduler"), done)
    assert killed == ["worker", "scheduler", "worker", "worker"]


def test_a_rate_needs_four_drives(tmp_path):
    write_car_frames(tmp_path / "a", frames=1)
    with fault(DriveError, expected="at least 4", found="1 of"):
        fleet([str(tmp_path / "a")], config=FleetConfig(), out=tmp_path / "fleet.png")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a"]
