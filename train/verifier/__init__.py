"""Training of DepthCN's network, which classifies proposals as vehicles."""
