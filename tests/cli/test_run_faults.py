"""`trifuse run --fault`: the results name the fault of the sensor, and a wrong one is refused in a sentence."""

from data.results.run_folder import RunFolder
from perception.cli.main import main
from perception.errors import UsageError
from tests.faults import command, fault


def test_the_results_name_the_faults(street, tmp_path, capsys):
    out = tmp_path / "results"
    words = ["run", str(street), "--out", str(out), "--no-video", "--pipeline.no-parallel"]
    assert main([*words, "--fault", "ins-absent:2-3,camera-missing:1-2"]) == 0
    folder = RunFolder(out)
    named = [[one.fault for one in frame.health] for frame in folder.frames()]
    assert named[:2] == [[], ["camera missing"]]
    assert sorted(named[2]) == ["INS absent", "camera missing"]
    assert named[3] == ["INS absent"]
    printed = capsys.readouterr().out
    assert "health: OK in 1 of 4 frames\n" in printed
    missing = "the frame has no image, those before it had one"
    assert f"\n  camera missing in 2 from frame 1 on (ERROR): {missing}\n" in printed
    faults = folder.summary()["health"]["faults"]
    assert {name: (one["level"], one["frames"], one["first"]) for name, one in faults.items()} == {
        "camera missing": ("ERROR", 2, 1),
        "INS absent": ("ERROR", 2, 2),
    }
    page = (out / "report.html").read_text()
    assert "the frame has no pose, those before it had one" in page


def true_ground_points(printed: str) -> int:
    table = printed[printed.index("points against the truth") :]
    return int(table.split("\nground ")[1].split()[4])


def test_the_truth_of_points_is_not_that_of_a_faulty_scan(street, tmp_path, capsys):
    words = ["run", str(street), "--out", str(tmp_path / "r"), "--no-video", "--no-report"]
    assert main([*words, "--fault", "lidar-sector:1-3:90"]) == 0
    one_of_four = true_ground_points(capsys.readouterr().out)
    assert main(["run", str(street), "--out", str(tmp_path / "s"), *words[4:]]) == 0
    all_four = true_ground_points(capsys.readouterr().out)
    assert 0.2 < one_of_four / all_four < 0.3


def test_an_unknown_fault_is_refused(street, tmp_path):
    with fault(UsageError, "--fault", "camera-dark", "camera-drunk"):
        command("run", street, "--out", tmp_path / "r", "--fault", "camera-drunk:1-2")
