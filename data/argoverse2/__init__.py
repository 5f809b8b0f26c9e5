"""Argoverse 2 sensor logs: sweeps of two LiDARs, ring cameras, poses, annotations, scene flow."""
