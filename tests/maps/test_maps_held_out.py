"""Returns that were left out are told better than by the thesis' triangles, on a real scan."""

import numpy as np

from benchmarks.maps import held_out_errors
from data.open_drive import open_drive
from perception.maps.projection import project_frame


def test_default_tells_left_out_returns_better_than_triangles(kitti_root):
    frame = open_drive(kitti_root / "object")[12]
    errors = held_out_errors([project_frame(frame)], np.random.default_rng(0))
    trifuse, thesis = errors["Trifuse"], errors["thesis: Delaunay, nearest vertex (SciPy)"]
    assert len(trifuse.depth_m) > 1000
    assert trifuse.depth_m.mean() < 0.8 * thesis.depth_m.mean()
    assert trifuse.is_close.mean() > thesis.is_close.mean() + 0.01
    assert trifuse.reflectance.mean() < thesis.reflectance.mean()
