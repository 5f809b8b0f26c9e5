"""Poses of the LiDAR: registration of scans, alignment, and the check of the mounting."""

from perception.geometry.threads import set_passive_openmp_wait

# Before small_gicp loads OpenMP.
set_passive_openmp_wait()
