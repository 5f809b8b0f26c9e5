"""Trained networks out, as ONNX."""
