"""The benchmark prints every comparison, and says what it leaves out."""

import json
from pathlib import Path

from benchmarks import average_precision
from perception.cli.main import main


def bench(json_file: Path, *words: str) -> dict:
    assert main(["bench", "--frames", "2", "--json", str(json_file), *words]) == 0
    return json.loads(json_file.read_text())


def test_every_part_prints_a_table_and_its_ratios(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(average_precision, "_SETS", 1)
    monkeypatch.setattr(average_precision, "_FRAMES", 25)
    # Reference implementations loop over points, of which this sensor has the fewest.
    document = bench(tmp_path / "bench.json", "--chain-frames", "3", "--sensor", "VLP-16")
    printed = capsys.readouterr().out
    for title in ("obstacle chain", "registration", "ground", "voxel counting"):
        assert f"\n{title}" in printed
    for part in ("registration", "ground", "voxels", "motion"):
        ratios = {name: row["relative_time"] for name, row in document[part].items()}
        assert ratios["Trifuse"] == 1.0
        assert len(ratios) >= 2
    # Exact truth of the synthetic street.
    assert document["ground"]["Trifuse"]["f1"] > 0.9
    assert document["motion"]["Trifuse"].keys() >= {"precision", "recall", "f1", "iou", "cpu_ms"}
    assert document["registration"]["Trifuse"]["1 s p50 [mm]"] < 100
    detections = {name: row["detections"] for name, row in document["depthcn"].items()}
    assert detections["reference: one proposal at a time"] == detections["Trifuse"] > 0
    precisions = document["average-precision"].values()
    assert max(row["largest_difference"] for row in precisions) < 1e-9
    assert document["chain"]["default"]["memory_end_mib"] > 0
    assert document["configuration"]["chain_frames"] == 3


def test_one_part_measures_the_ground_of_a_dense_scan(tmp_path):
    document = bench(tmp_path / "ground.json", "--part", "ground")
    assert document["ground"]["Trifuse"]["mDE [mm]"] < 30.0
    assert "voxels" not in document
