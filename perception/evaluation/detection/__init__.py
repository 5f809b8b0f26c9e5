"""How well boxes are detected in images: KITTI's average precision, arrays in, named results out."""
