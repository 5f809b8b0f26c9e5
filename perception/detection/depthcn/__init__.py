"""DepthCN: candidates for vehicles of the scan, verified by a network (6.1)."""
