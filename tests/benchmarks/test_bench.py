"""The benchmark prints every comparison, and says what it leaves out."""

import json

from perception.cli.main import main


def test_every_part_prints_a_table_and_its_ratios(tmp_path, capsys):
    path = tmp_path / "bench.json"
    assert main(["bench", "--frames", "2", "--chain-frames", "3", "--json", str(path)]) == 0
    printed = capsys.readouterr().out
    for title in ("obstacle chain", "registration", "ground", "voxel counting"):
        assert f"\n{title}" in printed
    document = json.loads(path.read_text())
    for part in ("registration", "ground", "voxels", "motion"):
        ratios = {name: row["relative_time"] for name, row in document[part].items()}
        assert ratios["Trifuse"] == 1.0
        assert len(ratios) >= 2
    detections = {name: row["detections"] for name, row in document["depthcn"].items()}
    assert detections["reference: one proposal at a time"] == detections["Trifuse"]
    assert document["ground"]["Trifuse"]["mDE [mm]"] < 30.0
    assert document["chain"]["default"]["memory_end_mib"] > 0
    assert document["configuration"]["chain_frames"] == 3
