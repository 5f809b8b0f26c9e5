from data.derived.obstacle_sequences import table_3_1
from perception.evaluation.config import ObjectMatchConfig
from perception.evaluation.obstacle_counts import ObstacleCounts
from perception.evaluation.obstacle_measure import ObstacleReport
from perception.evaluation.obstacle_sets import ObstacleSetReport

FIRST, SECOND, THIRD = (row.name for row in table_3_1()[:3])


def report_of(*counts: ObstacleCounts, is_exact: bool = False) -> ObstacleReport:
    """Return the report of a sequence with one moving object and three static ones."""
    motions = {"1": "moving", "2": "static", "4": "static", "9": "static"}
    return ObstacleReport(
        ObjectMatchConfig(),
        None if counts else "No motion of objects.",
        dict(enumerate(counts)),
        is_exact,
        motions if counts else {"1": "unknown"},
    )


def test_a_sequence_is_the_sum_of_its_frames_and_the_last_row_that_of_all():
    one, two = ObstacleCounts(5, 2, 1, 0, 0, 3), ObstacleCounts(7, 1, 0, 1, 2, 0)
    reports = {FIRST: report_of(one, two), THIRD: report_of(two)}
    by_labels, printed, motions = ObstacleSetReport(reports, table_3_1()).tables()
    assert by_labels.rows == {FIRST: one + two, THIRD: two, "Total": one + two + two}
    assert printed.rows["Total"] == ObstacleCounts(3011, 1201, 186, 3, 90, 31)
    assert list(printed.rows) == [*(row.name for row in table_3_1()), "Total"]
    total = motions.rows["Total"]
    assert (total.static, total.moving, total.unknown) == (6, 2, 0)
    assert (total.thesis_static, total.thesis_moving) == (36, 19)


def test_counts_by_labels_and_by_exact_truth_are_not_added():
    counts = ObstacleCounts(5, 2)
    reports = {FIRST: report_of(counts), SECOND: report_of(counts, is_exact=True)}
    by_labels, exact, *_ = ObstacleSetReport(reports, table_3_1()).tables()
    assert by_labels.rows == {FIRST: counts, "Total": counts}
    assert exact.rows == {SECOND: counts, "Total": counts}
    assert by_labels.title != exact.title


def test_a_sequence_without_motion_has_no_counts_but_a_note():
    counts = ObstacleCounts(5, 2)
    report = ObstacleSetReport({FIRST: report_of(counts), SECOND: report_of()}, table_3_1())
    by_labels, _, motions = report.tables()
    assert list(by_labels.rows) == [FIRST, "Total"]
    assert motions.rows[SECOND].unknown == 1
    assert f"{SECOND}: No motion of objects." in motions.notes
    assert list(report.to_json()["counts"]) == [FIRST, "Total"]
