"""DepthCN's network: how it learns to tell vehicles among candidates, and what is watched meanwhile."""
