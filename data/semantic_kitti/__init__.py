"""SemanticKITTI: KITTI's odometry sequences with a class and an instance for every point."""
