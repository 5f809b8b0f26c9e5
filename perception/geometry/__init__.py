"""Rigid transforms, the pinhole camera, boxes, footprints and grids."""

from perception.geometry.threads import set_passive_openmp_wait

set_passive_openmp_wait()
