"""A pipeline that goes on from the state of another one says the same, to the last bit."""

from dataclasses import replace

import numpy as np
import pytest

from data.synthetic.drive import SyntheticDrive
from perception.pipeline import Pipeline, PipelineConfig
from perception.sensor import VLP_16
from perception.snapshot import write_snapshot

FRAMES, BEFORE = 7, 4


@pytest.mark.parametrize("method", ["default", "thesis"])
def test_results_after_a_snapshot_are_the_same(method):
    drive = SyntheticDrive(FRAMES, sensor=VLP_16, images=False)
    config = replace(PipelineConfig.for_motion(method), method=method, parallel=False)
    with Pipeline(drive.sensor, config) as whole:
        results = list(whole.stream(drive, snapshot_frames=BEFORE))
    assert [one.snapshot is not None for one in results] == [i == BEFORE - 1 for i in range(FRAMES)]
    with Pipeline(drive.sensor, config) as other:
        other.restore(results[BEFORE - 1].snapshot)
        for index in range(BEFORE, FRAMES):
            found, expected = other.step(drive[index]), results[index]
            assert np.array_equal(found.world_SE3_velo, expected.world_SE3_velo)
            for name in ("tracks", "obstacles", "ground"):
                of_both = (write_snapshot(getattr(one, name)) for one in (found, expected))
                assert next(of_both) == next(of_both), (index, name)
