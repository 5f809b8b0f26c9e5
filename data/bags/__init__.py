"""Recordings of robots in one file: ROS 2 bags (MCAP, SQLite), ROS 1 bags, read message by message."""
