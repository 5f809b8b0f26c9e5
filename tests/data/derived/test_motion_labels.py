import numpy as np
import pytest

from data.derived.motion_labels import PosedLabels, TrackPositions, gather_tracks, label_motion
from data.kitti.calibration import read_benchmark_calibration
from data.kitti.labels import read_tracking_labels
from data.kitti.oxts import Mercator, parse_oxts_packet
from perception.errors import UsageError
from perception.evaluation.config import MotionLabelConfig
from perception.evaluation.objects import MotionState
from perception.geometry.se3 import from_euler, inverse
from perception.types import Boxes3D, Labels
from tests.faults import fault

SCAN_S = 0.1


def one_track(x_m: np.ndarray, track_id: int = 7) -> TrackPositions:
    count = len(x_m)
    return TrackPositions(
        frames=np.arange(count),
        stamps_s=np.arange(count) * SCAN_S,
        track_ids=np.full(count, track_id),
        positions_world=np.column_stack([x_m, np.zeros(count), np.zeros(count)]),
    )


def drive_then(speeds_m_s: list[tuple[float, float]]) -> np.ndarray:
    """Return positions of an object that keeps each speed for so many seconds."""
    per_scan = [np.full(round(seconds / SCAN_S), speed) for speed, seconds in speeds_m_s]
    return np.cumsum(np.concatenate(per_scan)) * SCAN_S


def labels_at(x_m: float, y_m: float, track_id: int) -> Labels:
    return Labels(
        boxes_velo=Boxes3D(np.array([[x_m, y_m, -1.7]]), np.array([[4.0, 1.8, 1.5]]), np.zeros(1)),
        boxes_px=np.zeros((1, 4)),
        types=np.array(["Car"]),
        track_ids=np.array([track_id]),
        truncation=np.zeros(1),
        occlusion=np.zeros(1, np.int64),
        dont_care_px=np.zeros((0, 4)),
    )


def test_an_object_that_stops_for_a_while_stands_in_that_while():
    motions = label_motion(one_track(drive_then([(5.0, 3.0), (0.0, 3.0), (5.0, 3.0)]))).motions
    assert (motions[:28] == MotionState.MOVING).all()
    assert (motions[36:54] == MotionState.STATIC).all()
    assert (motions[62:] == MotionState.MOVING).all()


def test_a_walker_who_slows_down_between_the_thresholds_goes_on_moving():
    walk = drive_then([(1.2, 2.0), (0.7, 2.0), (1.2, 2.0)])
    assert (label_motion(one_track(walk)).motions == MotionState.MOVING).all()


def test_creeping_that_never_reaches_the_upper_threshold_is_unknown():
    assert (label_motion(one_track(drive_then([(0.7, 4.0)]))).motions == MotionState.UNKNOWN).all()


def test_jitter_and_one_bad_box_do_not_move_a_parked_car():
    rng = np.random.default_rng(3)
    x_m = rng.normal(0, 0.1, 60)
    x_m[25] += 2.0
    assert (label_motion(one_track(x_m)).motions == MotionState.STATIC).all()


def test_drift_of_a_parked_car_is_no_motion():
    assert (label_motion(one_track(drive_then([(0.5, 5.0)]))).motions == MotionState.STATIC).all()


def test_the_vehicles_pitch_moves_no_object():
    track = one_track(np.zeros(40))
    track.positions_world[:, 2] = np.linspace(0, 8, 40)
    assert (label_motion(track).motions == MotionState.STATIC).all()


@pytest.mark.parametrize(
    ("boxes", "speed_mps", "expected"),
    [
        (1, 0.0, MotionState.UNKNOWN),  # nothing can be said of one box
        (4, 0.0, MotionState.UNKNOWN),  # too short to say that it stands
        (4, 1.3, MotionState.UNKNOWN),  # 0.4 m: a walker, or jitter
        (4, 3.0, MotionState.MOVING),
        (6, 0.0, MotionState.STATIC),
    ],
)
def test_short_tracks(boxes: int, speed_mps: float, expected: MotionState):
    track = one_track(np.arange(boxes) * speed_mps * SCAN_S)
    assert (label_motion(track).motions == expected).all()


def test_speed_is_that_of_the_object_over_the_ground():
    speeds = label_motion(one_track(drive_then([(3.0, 2.0)]))).speeds_m_s
    np.testing.assert_allclose(speeds, 3.0, rtol=1e-9)


def test_velocities_have_the_world_s_axes():
    track = one_track(np.zeros(12))
    track.positions_world[:, 0] = 2.0 * track.stamps_s
    track.positions_world[:, 1] = -1.5 * track.stamps_s
    motion = label_motion(track)
    np.testing.assert_allclose(motion.velocities_m_s, np.tile([2.0, -1.5], (12, 1)), rtol=1e-9)
    np.testing.assert_allclose(motion.speeds_m_s, 2.5, rtol=1e-9)
    assert motion.velocities_of(4, np.array([7, 8])).tolist()[0] == pytest.approx([2.0, -1.5])
    assert np.isnan(motion.velocities_of(4, np.array([7, 8]))[1]).all()
    assert motion.velocities_of(4, np.zeros(0, np.int64)).shape == (0, 2)


def test_the_order_of_the_rows_does_not_matter():
    track = one_track(drive_then([(5.0, 2.0), (0.0, 2.0)]))
    order = np.random.default_rng(0).permutation(len(track.frames))
    shuffled = TrackPositions(
        track.frames[order],
        track.stamps_s[order],
        track.track_ids[order],
        track.positions_world[order],
    )
    np.testing.assert_array_equal(
        label_motion(shuffled).motions, label_motion(track).motions[order]
    )


def test_a_parked_car_seen_from_a_moving_and_turning_vehicle_stands():
    posed = []
    for frame in range(20):
        world_SE3_velo = from_euler(0, 0, 0.05 * frame, np.array([0.5 * frame, 0.0, 0.0]))
        x, y, _ = (inverse(world_SE3_velo) @ (20.0, 3.0, 0.0, 1.0))[:3]
        posed.append(PosedLabels(frame, frame * SCAN_S, world_SE3_velo, labels_at(x, y, 4)))
    motion = label_motion(gather_tracks(posed))
    assert motion.moving_tracks() == []
    assert motion.of(5, np.array([4, 9])).tolist() == [MotionState.STATIC, MotionState.UNKNOWN]


def test_objects_without_a_track_are_left_out():
    posed = [PosedLabels(0, 0.0, np.eye(4), labels_at(10, 0, -1))]
    assert len(gather_tracks(posed).frames) == 0
    assert label_motion(gather_tracks(posed)).moving_tracks() == []


def test_thresholds_out_of_order_are_refused():
    with fault(UsageError, expected="stop_m_s <= start_m_s"):
        MotionLabelConfig(start_m_s=0.5, stop_m_s=0.8)


def kitti_tracks(kitti_root, sequence: str, *, has_ins: bool) -> TrackPositions:
    """Return the tracks of a sequence; without INS, of a vehicle that stands."""
    training = kitti_root / "tracking" / "training"
    calibration = read_benchmark_calibration(training / "calib" / f"{sequence}.txt")
    labels = read_tracking_labels(training / "label_02" / f"{sequence}.txt", calibration.camera)
    poses = dict.fromkeys(labels, np.eye(4))
    if has_ins:
        path = training / "oxts" / f"{sequence}.txt"
        packets = [parse_oxts_packet(row, path) for row in path.read_text().splitlines()]
        world = Mercator.around(packets[0])
        velo_SE3_imu = calibration.velo_SE3_imu
        poses = {
            frame: world.world_SE3_imu(packet) @ inverse(velo_SE3_imu)
            for frame, packet in enumerate(packets)
        }
    return gather_tracks(
        [
            PosedLabels(frame, frame * SCAN_S, poses[frame], labels[frame])
            for frame in sorted(labels)
        ]
    )


def test_sequence_0000_has_the_five_moving_objects_of_the_thesis(kitti_root):
    motion = label_motion(kitti_tracks(kitti_root, "0000", has_ins=True))
    assert motion.moving_tracks() == [0, 1, 2, 4, 12]
    assert len(np.unique(motion.track_ids)) - 5 == 10  # Table 3.1 counts 11 stationary ones
    assert MotionState.UNKNOWN not in motion.motions


# Table 3.1 counts 17 and 10. Which of the eleven objects of 0017 it leaves out is not known.
@pytest.mark.parametrize(("sequence", "moving_in_area"), [("0016", 17), ("0017", 11)])
def test_sequences_with_a_standing_vehicle(kitti_root, sequence: str, moving_in_area: int):
    motion = label_motion(kitti_tracks(kitti_root, sequence, has_ins=False))
    tracks = kitti_tracks(kitti_root, sequence, has_ins=False)
    x, y = tracks.positions_world[:, 0], tracks.positions_world[:, 1]
    in_area = set(tracks.track_ids[(x > -5) & (x < 25) & (np.abs(y) < 10)].tolist())
    assert len(in_area & set(motion.moving_tracks())) == moving_in_area
