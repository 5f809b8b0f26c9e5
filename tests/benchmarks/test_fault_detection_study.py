"""`trifuse study fault-detection`: faults of the calibration are measured like the others, and drives are required."""

from dataclasses import replace

import numpy as np

from benchmarks.studies.monitored_recording import MonitoredRecording
from data.faults.injection import Fault
from perception.errors import UsageError
from perception.sensor import HDL_64E
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
