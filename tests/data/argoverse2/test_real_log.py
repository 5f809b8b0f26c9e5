"""A real log of two sweeps, with boxes and labels of scene flow; skipped where there is none."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import velodyne_decoder
import yaml
from pyarrow import feather
from scipy.spatial.transform import Rotation

from data.derived.motion_labels import label_drive_motion
from data.inspection import inspect_drive
from data.open_drive import open_drive
from data.recorded_drive import RecordedDrive
from perception.evaluation.confusion import Confusion
from perception.evaluation.ground import ground_confusion
from perception.evaluation.obstacles import motion_confusions
from perception.geometry.grids import MOVING_OBJECT_AREA
from perception.pipeline import Pipeline, PipelineConfig

_SHARED = Path(__file__).parents[4] / "shared" / "real"
FIRST_NS = 315966265259836000
CONFIG = PipelineConfig.for_motion()


@pytest.fixture(scope="module")
def root() -> Path:
    found = Path(os.environ.get("REAL_ROOT", _SHARED)) / "av2"
    if not found.is_dir():
        pytest.skip(f"{found} is not here: set REAL_ROOT")
    return found


@pytest.fixture(scope="module")
def drive(root) -> RecordedDrive:
    return open_drive(root, images=False)


def test_it_is_read_whole(drive):
    assert [len(frame.points_velo) for frame in drive] == [99229, 99466]
    assert 60 <= drive.sensor.beams <= 64  # some of both LiDARs point to the same elevation
    assert np.degrees(drive.sensor.elevations_rad[[0, -1]]) == pytest.approx([24.6, -25.0], abs=0.1)
    assert drive.sensor.height_m == pytest.approx(2.0, abs=0.01)
    assert [one.first_example for one in inspect_drive(drive).findings if one.is_fault] == []


def test_truth_of_boxes_and_map_is_that_of_scene_flow(drive):
    """What is derived for sweeps without a file agrees with the file of the first, made by the data set's authors."""
    flow = drive.point_truth(0)
    derived = replace(drive, truth=replace(drive.truth, flow_files={})).point_truth(0)
    assert np.mean(flow.is_moving == derived.is_moving) > 0.9999
    assert np.mean(flow.classes == derived.classes) > 0.999
    assert np.count_nonzero(flow.is_moving) == 2037


def test_boxes_of_the_whole_log_tell_what_moves(drive):
    motion = label_drive_motion(drive)
    moving = motion.moving_tracks()
    in_frames = np.unique(motion.track_ids[motion.frames >= 0])
    assert 0 < np.isin(in_frames, moving).sum() < len(in_frames)


def test_ground_and_motion(drive):
    """The second sweep has one as history: what moves by less than a voxel within 0.1 s is not seen."""
    with Pipeline(drive.sensor, CONFIG) as pipeline:
        _, result = [pipeline.step(frame) for frame in drive]
    truth, states = drive.point_truth(1), result.obstacles.point_states
    points_velo = result.frame.points_velo
    around, near = (
        sum(ground_confusion(points_velo, states, truth.classes, area).values(), Confusion())
        for area in (CONFIG.area_of(drive.sensor), MOVING_OBJECT_AREA)
    )
    assert around.precision == pytest.approx(0.981, abs=2e-3)
    assert around.recall == pytest.approx(0.967, abs=2e-3)
    assert (near.precision, near.recall) == (
        pytest.approx(1, abs=2e-3),
        pytest.approx(1, abs=0.01),
    )
    moving = motion_confusions(states, truth.classes, truth.is_moving)["moving"]
    assert moving.precision > 0.99
    assert moving.recall == pytest.approx(0.81, abs=0.03)


def test_beams_of_a_vlp_32c_point_to_where_its_packets_say(root):
    """The upper LiDAR is one: its azimuths follow from the times of its points and the offset of each laser."""
    (log,) = (path for path in root.iterdir() if path.is_dir())
    sweep = min(log.glob("sensors/lidar/*.feather"))
    poses = feather.read_table(log / "calibration" / "egovehicle_SE3_sensor.feather").to_pydict()
    row = poses["sensor_name"].index("up_lidar")
    turn = Rotation.from_quat([poses[name][row] for name in ("qx", "qy", "qz", "qw")])
    place_m = [poses[name][row] for name in ("tx_m", "ty_m", "tz_m")]
    table = {name: np.array(one) for name, one in feather.read_table(sweep).to_pydict().items()}
    xyz_m = np.stack([table[name] for name in "xyz"], axis=1)[table["laser_number"] < 32]
    lasers, offsets_ns = (
        table[name][table["laser_number"] < 32] for name in ("laser_number", "offset_ns")
    )
    x, y, z = turn.inv().apply(xyz_m - place_m).T
    elevations_deg = np.degrees(np.arctan2(z, np.hypot(x, y)))
    turned = np.exp(1j * (np.arctan2(-y, x) - 2 * np.pi * offsets_ns / 1e8))
    azimuths_deg = np.degrees(np.angle(turned / turned.mean()))
    model = velodyne_decoder.Calibration.default_calibs[velodyne_decoder.Model.VLP32C]
    beams = yaml.safe_load(model.to_string())["lasers"]
    stated_deg = np.degrees([(one["vert_correction"], -one["rot_correction"]) for one in beams])
    measured_deg = [
        [np.median(of_all[lasers == laser]) for of_all in (elevations_deg, azimuths_deg)]
        for laser in range(32)
    ]
    by_elevation = [
        np.array(sorted(rows, key=lambda row: row[0]))
        for rows in (stated_deg.tolist(), measured_deg)
    ]
    assert np.abs(np.subtract(*by_elevation)).max() < 0.06
