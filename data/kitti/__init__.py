"""KITTI raw, tracking and object layouts; its conventions end here."""
