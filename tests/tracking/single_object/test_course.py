import numpy as np
import pytest

from perception.tracking.single_object.course import (
    heading_freeze_config_for,
    heading_from_course,
)

CAR = heading_freeze_config_for(np.array([4.0, 1.8, 1.5]))
WALKER = heading_freeze_config_for(np.array([0.8, 0.6, 1.8]))


@pytest.mark.parametrize(
    ("config", "displacement_m", "last_rad", "expected_rad"),
    [
        pytest.param(CAR, (0.0, 0.5), 0.0, np.pi / 2, id="fast car turns"),
        pytest.param(CAR, (0.0, 0.3), 0.0, 0.0, id="slow car keeps its heading"),
        pytest.param(CAR, (0.3, 0.03), 0.0, 0.0997, id="slow car turns a little"),
        pytest.param(CAR, (-0.3, 0.01), np.pi - 0.01, np.pi - 0.0333, id="across the half turn"),
        pytest.param(CAR, (-0.3, -0.01), np.pi - 0.01, -np.pi + 0.0333, id="and past it"),
        pytest.param(WALKER, (0.0, 0.06), 0.0, np.pi / 2, id="walker turns on the spot"),
        pytest.param(WALKER, (0.0, 0.04), 0.0, 0.0, id="standing walker does not"),
        pytest.param(WALKER, (0.0, 0.0), 1.0, 1.0, id="no way at all"),
    ],
)
def test_heading(config, displacement_m, last_rad, expected_rad):
    found = heading_from_course(np.array(displacement_m), 0.1, last_rad, config)
    assert found == pytest.approx(expected_rad, abs=1e-3)


def test_slowness_is_a_speed_not_a_way():
    assert heading_from_course(np.array([0.0, 0.5]), 0.2, 0.0, CAR) == 0.0
    assert heading_from_course(np.array([0.0, 0.5]), 0.1, 0.0, CAR) == pytest.approx(np.pi / 2)


def test_no_time_keeps_the_heading():
    assert heading_from_course(np.array([0.0, 5.0]), 0.0, 0.3, CAR) == 0.3
