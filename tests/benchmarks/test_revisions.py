"""Two revisions are compared stage by stage, frame by frame."""

import json

import pytest

from benchmarks import revisions
from benchmarks.revision_worker import FRAME, SORTED
from benchmarks.revisions import IN_SORTS, ROOT, source_tree, stage_ratios
from perception.cli.main import main
from perception.errors import UsageError
from tests.faults import fault

in_a_clone = pytest.mark.skipif(not (ROOT / ".git").exists(), reason="no clone of the repository")


def test_a_ratio_is_the_median_over_frames_of_both():
    # The machine is twice as slow from the second frame on; the ratio is not.
    other = [{"ground": s, FRAME: 2 * s, SORTED: 0.01} for s in (0.010, 0.020, 0.020)]
    this = [{"ground": s, FRAME: 2 * s, SORTED: 0.01} for s in (0.005, 0.010, 0.012)]
    rows = stage_ratios("", other, this).rows
    assert rows["ground"].ratio == pytest.approx(0.5)
    assert rows["ground"].other_ms == pytest.approx(20.0)
    assert rows["ground"].this_ms == pytest.approx(10.0)
    assert rows["ground"].ratio_p75 == pytest.approx(0.55)
    assert rows[IN_SORTS].this_ms == pytest.approx(2.0)  # 20 ms a frame, 10 ms a sort


def test_a_stage_of_one_revision_alone_has_no_ratio():
    other, this = [{FRAME: 1.0, SORTED: 1.0}], [{"new": 0.5, FRAME: 1.0, SORTED: 1.0}]
    row = stage_ratios("", other, this).rows["new"]
    assert (row.other_ms, row.this_ms, row.ratio) == (None, 500.0, None)


@in_a_clone
def test_an_unknown_revision_is_named():
    where, expected = "--compare no-such-revision", "a revision that git knows"
    with fault(UsageError, where, expected), source_tree("no-such-revision"):
        pass


@in_a_clone
@pytest.mark.slow
def test_both_revisions_run_every_stage(tmp_path, monkeypatch):
    monkeypatch.setattr(revisions, "WARM_UP", 3)
    words = ["--compare", "HEAD", "--frames", "4", "--sensor", "VLP-16"]
    assert main(["bench", *words, "--json", str(tmp_path / "times.json")]) == 0
    stages = json.loads((tmp_path / "times.json").read_text())["stages"]
    assert {
        "registration",
        "ground",
        "bev detector",
        "rgb detector",
        "vehicles",
        FRAME,
    } <= stages.keys()
    assert all(row["other_ms"] > 0 and row["this_ms"] > 0 for row in stages.values())


def test_the_ratio_of_means_counts_what_few_frames_do():
    other = [{FRAME: 0.1, SORTED: 0.01}] * 9
    this = [*other[:8], {FRAME: 1.0, SORTED: 0.01}]
    row = stage_ratios("", other, this).rows[FRAME]
    assert row.ratio == pytest.approx(1)
    assert row.ratio_of_means == pytest.approx(2)
