"""DepthCN: vehicle proposals of the scan, verified by a network (6.1)."""
