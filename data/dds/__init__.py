"""ROS 2 without ROS: its topics by DDS, messages in the binary form that both share."""
