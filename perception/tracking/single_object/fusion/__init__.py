"""H-Fus, the fusion tracker of the thesis (5.3)."""
