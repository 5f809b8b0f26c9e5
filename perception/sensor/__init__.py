"""LiDAR models: all that an algorithm may know of the sensor."""

from perception.sensor.files import load_sensor, sensor_to_json
from perception.sensor.model import LidarModel
from perception.sensor.models import HDL_32E, HDL_64E, SENSORS, VLP_16

__all__ = [
    "HDL_32E", "HDL_64E", "SENSORS", "VLP_16", "LidarModel", "load_sensor", "sensor_to_json",
]  # fmt: skip
