"""Drives in: KITTI layouts, synthetic worlds, and the data sets derived from them."""
