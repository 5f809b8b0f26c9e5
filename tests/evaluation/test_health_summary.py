"""Faults of a drive, a line each."""

from perception.evaluation.run_summary import HealthSummary
from perception.types import Health, HealthFinding, HealthLevel


def test_each_fault_of_a_drive_has_a_line():
    summary = HealthSummary()
    late = HealthFinding("lidar", HealthLevel.WARN, "beams lost", "2 of 64")
    dim = HealthFinding("camera", HealthLevel.WARN, "camera dark", "dim")
    dark = HealthFinding("camera", HealthLevel.ERROR, "camera dark", "black")
    summary.update(4, Health())
    assert summary.text() == "health: OK in all 1 frames"
    for frame, findings in enumerate([[late], [dim], [dark], []], start=5):
        summary.update(frame, Health.of(findings))
    assert summary.text() == (
        "health: OK in 2 of 5 frames\n"
        "  camera dark in 2 from frame 6 on (ERROR): dim\n"
        "  beams lost in 1 from frame 5 on (WARN): 2 of 64"
    )
    written = summary.to_json()
    assert (written["frames"], summary.healthy, list(written["faults"])) == (
        5,
        2,
        ["beams lost", "camera dark"],
    )
    assert written["faults"]["camera dark"] == {
        "part": "camera", "level": "ERROR", "frames": 2, "first": 6, "reason": "dim",
    }  # fmt: skip
