"""Training data of DepthCN's network: crops of proposals and labels, augmented."""
