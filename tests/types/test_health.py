"""Health of a frame: the worst finding counts."""

from perception.types import Health, HealthFinding, HealthLevel

DARK = HealthFinding("camera", HealthLevel.ERROR, "camera dark", "no pixel is above 12 of 255")
LATE = HealthFinding("lidar", HealthLevel.WARN, "scan late", "0.21 s after the scan before")
DIRTY = HealthFinding("camera", HealthLevel.WARN, "camera dirty", "blurred in the left third")


def test_without_findings_all_is_well():
    health = Health()
    assert (health.level, health.levels, str(health)) == (HealthLevel.OK, {}, "OK")
    assert health.level_of("camera") is HealthLevel.OK


def test_the_worst_finding_of_a_part_is_its_level():
    health = Health.of([LATE, DIRTY, DARK])
    assert health.findings == (DARK, LATE, DIRTY)
    assert health.level is HealthLevel.ERROR
    assert health.levels == {"camera": HealthLevel.ERROR, "lidar": HealthLevel.WARN}
    assert health.level_of("ins") is HealthLevel.OK
    assert health.faults == ("camera dark", "scan late", "camera dirty")


def test_findings_are_joined():
    joined = Health.of([LATE]).joined([DARK])
    assert joined.findings == (DARK, LATE)
    assert str(joined) == (
        "ERROR camera dark: no pixel is above 12 of 255; WARN scan late: 0.21 s after the scan before"
    )
