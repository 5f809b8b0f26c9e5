"""Point clouds in files: .bin, .npy, .npz, .pcd, .ply, .csv."""
