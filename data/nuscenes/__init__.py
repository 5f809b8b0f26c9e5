"""nuScenes: tables of JSON, sweeps of one LiDAR, cameras, poses, annotations of key frames, classes of points."""
