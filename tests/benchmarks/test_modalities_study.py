"""Sets of modalities on a drive without a camera, by a detector whose answer is known."""

import json
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.studies.bev_evidence import NamedObjects, SeenFromAbove, count_names, fit_evidence
from benchmarks.studies.modalities import SetMetrics, Timed
from data.synthetic.collection import SynthConfig, write_drives
from perception.cli.main import main
from perception.detection.vehicles.bev_objects import log_odds
from perception.sensor import VLP_16
from perception.tracking.vehicles.evidence import probability
from tests.detection.filled_cells import filled_cells


def test_precision_is_set_beside_the_time_that_it_takes():
    metrics = SetMetrics(car=0.5, pedestrian=0.3, cost_ms=20.0)
    assert metrics.mean_ap == pytest.approx(0.4)
    assert metrics.per_ms == pytest.approx(2.0)


def test_the_first_frame_is_not_timed():
    timed = Timed(range(4))
    assert list(timed) == [0, 1, 2, 3]
    assert len(timed.seconds) == 3


def test_constants_are_those_that_made_what_was_found():
    random, count = np.random.default_rng(0), 20_000
    scores = random.uniform(0.05, 0.95, count)
    above = 2.5 * log_odds(scores) + 1.5
    is_unseen = random.random(count) < 0.4
    camera = np.where(is_unseen, np.nan, random.uniform(0.05, 0.95, count))
    fitting = np.nan_to_num(log_odds(camera)) + 0.2 * above + 0.6
    found = SeenFromAbove(
        is_vehicle=np.ones(count, bool),
        scores=scores,
        is_object=random.random(count) < probability(above),
        is_unseen=is_unseen,
        camera_scores=camera,
        fits=random.random(count) < probability(fitting),
        spread_ratios=random.uniform(0.5, 8.0, count),
        ious=np.empty((count, 2)),
    )
    # The box from above is the better one where its deviations are a third.
    is_better = found.spread_ratios > 3
    ious = np.column_stack([np.full(count, 0.6), np.where(is_better, 0.8, 0.4)])
    fitted = fit_evidence(replace(found, ious=ious))
    assert (fitted.slope, fitted.offset) == pytest.approx((2.5, 1.5), abs=0.1)
    assert (fitted.share, fitted.constant) == pytest.approx((0.2, 0.6), abs=0.06)
    assert fitted.unseen == pytest.approx(0.0, abs=0.1)
    assert fitted.ratio == 3


def test_names_are_counted_by_class_and_source():
    objects = NamedObjects(
        np.array(["Van", "Van", "Van", "Car"]),
        np.array(["Car", "Van", "Van", ""]),
        np.array(["Van", "", "", "Car"]),
    )
    names = count_names(objects)
    assert list(names) == ["Car", "Van"]
    assert (names["Car"].objects, names["Car"].in_image, names["Car"].above) == (1, "", "Car 100")
    assert (names["Van"].in_image, names["Van"].above) == ("Van 67, Car 33", "Van 100")


def test_each_set_has_a_row(tmp_path, capsys):
    [folder] = write_drives(
        tmp_path / "drive",
        SynthConfig(layout="tracking", frames=3, sensor=VLP_16, seed=4, images=False, street="jam"),
    )
    model, out = tmp_path / "bev.onnx", tmp_path / "modalities.png"
    model.write_bytes(filled_cells())
    words = ["study", "modalities", str(folder), "--sets", "bev", "--out", str(out)]
    assert main([*words, "--detection.bev-model", str(model)]) == 0
    (rows,) = json.loads(out.with_suffix(".json").read_text())["results"].values()
    assert set(rows) == {"bev"}
    assert 0 <= rows["bev"]["car"] <= 1
    assert np.isfinite(rows["bev"]["per_ms"])
    assert out.is_file()
    assert "VLP-16" in capsys.readouterr().out
