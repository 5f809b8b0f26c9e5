"""Grids as files, read again."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import yaml

from data.exports.occupancy_writer import OccupancyWriter
from perception.obstacles.occupancy import occupancy_grid
from tests.obstacles.test_occupancy import ROAD, post, result_of


def test_files_of_a_frame_as_a_map_server_reads_them(tmp_path: Path):
    writer = OccupancyWriter(tmp_path)
    result = result_of(ROAD, post(6.1, 0.1, 0.5))
    writer.add(replace(result, occupancy=occupancy_grid(result)), None)
    writer.close(is_complete=True)
    stated = yaml.safe_load((tmp_path / "occupancy/000000.yaml").read_text())
    image = cv2.imread(str(tmp_path / "occupancy" / stated["image"]), cv2.IMREAD_UNCHANGED)
    assert (stated["resolution"], stated["mode"], stated["negate"]) == (0.2, "trinary", 0)
    assert np.allclose(stated["origin"], [-20, -20, 0])
    # Rows of the image begin at the top. A map server takes the share of black as the probability of an obstacle.
    share = (255 - image[::-1].astype(float)) / 255
    state = np.where(
        share > stated["occupied_thresh"], 100, np.where(share < stated["free_thresh"], 0, -1)
    )
    arrays = np.load(tmp_path / "occupancy/000000.npz")
    assert np.array_equal(state, arrays["states"])
    assert set(np.unique(state)) == {-1, 0, 100}
    row, column = (int((value + 20) / 0.2) for value in (0.1, 6.1))
    assert state[row, column] == 100
    assert arrays["cell_m"] == 0.2
