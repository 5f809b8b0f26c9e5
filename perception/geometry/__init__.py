"""Rigid transforms, the camera, boxes, grids and registration."""

from perception.geometry.threads import let_waiting_threads_sleep

let_waiting_threads_sleep()
