"""A scan that matches nothing, without INS: it moves nothing, and bends nothing that was mapped before."""

from dataclasses import replace

import numpy as np

from data.synthetic.drive import SyntheticDrive
from perception.pipeline import Pipeline, PipelineConfig
from perception.types import PointState


def test_a_scan_of_another_place_adds_no_mover_and_is_forgotten():
    street, elsewhere = (SyntheticDrive(8, seed=seed, images=False) for seed in (3, 11))
    frames = [replace(street[index], world_SE3_velo=None) for index in range(8)]
    lost = list(frames)
    lost[4] = replace(frames[4], points_velo=elsewhere[0].points_velo)
    config = PipelineConfig.for_obstacles()
    found, whole = (
        [pipeline.step(frame) for frame in some]
        for some, pipeline in (
            (lost, Pipeline(street.sensor, config)),
            (frames, Pipeline(street.sensor, config)),
        )
    )
    assert [one.index for one in lost if "pose lost" in found[one.index].health.faults] == [4]
    states = np.bincount(found[4].obstacles.point_states, minlength=len(PointState))
    assert states[PointState.MOVING] == 0
    assert states[PointState.STATIC] > 1000 and states[PointState.GROUND] > 1000
    for after, expected in zip(found[5:], whole[5:], strict=True):
        off_m = np.linalg.norm(after.world_SE3_velo[:3, 3] - expected.world_SE3_velo[:3, 3])
        assert off_m < 0.03
        same = after.obstacles.point_states == expected.obstacles.point_states
        assert same.mean() > 0.995
