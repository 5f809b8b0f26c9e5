"""LiDAR models: all that an algorithm may know of the sensor."""

from perception.sensor.files import load_sensor, sensor_to_json
from perception.sensor.models import HDL_32E, HDL_64E, SENSORS, VLP_16
from perception.types import LidarModel

__all__ = [
    "HDL_32E", "HDL_64E", "SENSORS", "VLP_16", "LidarModel", "load_sensor", "sensor_to_json",
]  # fmt: skip
