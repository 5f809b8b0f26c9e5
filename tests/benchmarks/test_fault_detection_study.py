"""`trifuse study fault-detection`: faults of the calibration like the others, frame rates, and what is required."""

import json
from dataclasses import replace

import numpy as np

from benchmarks.studies.frame_rate import frame_step
from benchmarks.studies.monitored_recording import MonitoredRecording
from data.faults.injection import Fault
from data.synthetic.drive import SyntheticDrive
from perception.errors import UsageError
from perception.sensor import HDL_64E, VLP_16
from perception.types import Frame
from tests.board_scenes import TRUE, Boards
from tests.faults import command, fault

FRAMES, FIRST, WITHIN = 45, 15, 30


def boards_recording():
    """A drive that stands still before other boards in each frame."""
    scenes = [Boards.drawn(14, seed) for seed in range(7)]
    rng = np.random.default_rng(0)
    drawn = [Frame(0, 0.0, scene.scan(), scene.image(rng), calibration=TRUE) for scene in scenes]
    frames = [replace(drawn[i % 7], index=i, stamp_s=0.1 * i) for i in range(FRAMES)]
    return MonitoredRecording("boards", frames, [np.eye(4)] * FRAMES, HDL_64E)


def test_a_turned_calibration_is_named_in_time():
    recording = boards_recording()
    assert recording.parts == ["lidar", "camera", "calibration"]
    turned = Fault("calibration-yaw", FIRST, FIRST + WITHIN - 1, 2.0)
    assert recording.delay(turned, WITHIN) == 17
    assert recording.delay(replace(turned, size=0.0), WITHIN) is None


def test_neither_a_drive_nor_worlds_is_an_error():
    with fault(UsageError, where="ROOTS", found="neither", advice="--worlds 20"):
        command("study", "fault-detection")


def test_a_kind_that_is_none_is_an_error():
    with fault(UsageError, where="--kinds", expected="ins-drifting", found="ins-drift"):
        command("study", "fault-detection", "--worlds", "1", "--kinds", "ins-drift,ins-absent")


def test_faults_of_the_ins_are_named_at_two_frames_a_second(tmp_path):
    out = tmp_path / "faults.png"
    words = "--worlds 1 --world-sensors VLP-16 --world-images false --frames 22 --injections 1"
    kinds = "--kinds ins-jumping,ins-turning --rates 2"
    command("study", "fault-detection", *words.split(), *kinds.split(), "--out", str(out))
    results = json.loads(out.with_suffix(".json").read_text())["results"]
    assert {name: row["named"] for name, row in results["faults"].items()} == {
        "ins-jumping 2, 2 Hz": 1,
        "ins-turning 12, 2 Hz": 1,
    }
    assert results["faults"]["ins-turning 12, 2 Hz"]["mean_delay_s"] == 0.5
    clean = results["clean"]["2 Hz"]
    assert (clean["frames"], clean["seconds"], clean["false_alarms"]) == (22, 10.5, 0)


def test_a_recording_is_thinned_to_a_frame_rate():
    drive = SyntheticDrive(7, sensor=VLP_16, images=False)
    assert [frame_step(drive, rate_hz) for rate_hz in (None, 10, 5, 2, 3.3)] == [1, 1, 2, 5, 3]
    recording = MonitoredRecording.of(drive, 3, frame_step(drive, 5))
    assert [one.index for one in recording.frames] == [0, 1, 2]
    np.testing.assert_allclose([one.stamp_s for one in recording.frames], [0, 0.2, 0.4])
    with fault(UsageError, where="--rates", expected="at most 10 Hz", found="25"):
        frame_step(drive, 25)
