"""Results as messages of ROS 2 and Foxglove, for files and for live viewers."""
