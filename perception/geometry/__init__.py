"""Rigid transforms, the camera, boxes, grids and registration."""

import os

# small_gicp's OpenMP threads would spin while they wait, on cores that reader and video need too:
# measured 22 ms a registration instead of 70 beside a busy process. Read once, when it is loaded.
os.environ.setdefault("OMP_WAIT_POLICY", "passive")
