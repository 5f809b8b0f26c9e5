from data.derived.obstacle_sequences import PRINTED_MDE_M, table_3_1
from data.kitti.calibration import read_benchmark_calibration
from data.kitti.labels import read_tracking_labels
from perception.evaluation.obstacle_counts import ObstacleCounts

SEQUENCES = ["0000", "0001", "0011", "0013", "0015", "0016", "0017", "0018"]


def test_the_table_is_whole():
    rows = table_3_1()
    assert [row.sequence for row in rows] == SEQUENCES
    assert [row.name for row in rows][:2] == ["1 (0000)", "2 (0001)"]
    assert [row.frames for row in rows] == [154, 447, 373, 340, 376, 209, 145, 339]
    assert sum(row.static_objects for row in rows) == 131
    assert sum(row.moving_objects for row in rows) == 109
    assert rows[4].types == ("Car", "Cyclist", "Pedestrian")
    assert [row.ego_status for row in rows].count("stationary") == 2
    assert PRINTED_MDE_M == 0.086


def test_the_printed_counts_add_up_to_the_printed_total():
    total = sum((row.printed for row in table_3_1()), ObstacleCounts())
    assert total == ObstacleCounts(3011, 1201, 186, 3, 90, 31)


def test_labels_end_within_the_printed_frames(kitti_root):
    training = kitti_root / "tracking" / "training"
    for row in table_3_1():
        calibration = read_benchmark_calibration(training / "calib" / f"{row.sequence}.txt")
        labels = read_tracking_labels(
            training / "label_02" / f"{row.sequence}.txt", calibration.camera
        )
        assert max(labels) == row.frames - 1
        kinds = {str(kind) for frame in labels.values() for kind in frame.types}
        assert set(row.types) <= kinds
