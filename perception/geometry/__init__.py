"""Rigid transforms, the camera, boxes, grids and registration."""

from perception.geometry.threads import set_passive_openmp_wait

set_passive_openmp_wait()
