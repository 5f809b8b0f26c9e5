"""The benchmark prints every comparison, and says what it leaves out."""

import json

from perception.cli.main import main


def test_every_part_prints_a_table_and_its_ratios(tmp_path, capsys):
    path = tmp_path / "bench.json"
    assert main(["bench", "--frames", "2", "--chain-frames", "3", "--json", str(path)]) == 0
    printed = capsys.readouterr().out
    for title in ("whole chain", "registration", "ground", "voxel counting", "static and moving"):
        assert f"\n{title}" in printed
    document = json.loads(path.read_text())
    for part in ("registration", "ground", "voxels", "motion"):
        ratios = [timing["ratio"] for timing in document[part]["timings"]]
        assert ratios[0] == 1.0
        assert len(ratios) >= 2
    assert document["depthcn"]["timings"][1]["name"] == "reference: one proposal at a time"
    errors = document["ground"]["metrics"]["mDE [mm]"]
    assert float(errors["Trifuse"]) < 30.0
    assert document["chain"]["default"]["memory_end_mib"] > 0
