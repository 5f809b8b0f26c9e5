"""A detector of your own in the place of the camera's: the ONNX file of a YOLO, DETR or torchvision network.

python docs/examples/own_detector.py detector.onnx DRIVE
"""

import sys
from pathlib import Path

import numpy as np

from data.open_drive import open_drive
from perception.detection.config import DetectionConfig
from perception.pipeline import Pipeline, PipelineConfig
from perception.types import Result


def rows(result: Result, min_score: float) -> list[str]:
    """Return id, class, score and distance of each vehicle, the nearest first."""
    vehicles = result.vehicles
    assert vehicles is not None  # as a detector runs
    types, scores = vehicles.fused.detections.types, vehicles.fused.detections.scores
    return [
        f"{vehicles.ids[row]} {types[row]} {scores[row]:.2f} {vehicles.distances_m[row]:.1f} m"
        for row in np.argsort(vehicles.distances_m)  # NaN, not known, comes last
        if scores[row] >= min_score
    ]


def main(model: Path, folder: Path) -> None:
    """Print the vehicles of each frame of a drive."""
    config = PipelineConfig(detection=DetectionConfig(rgb_model=model))
    drive = open_drive(folder)
    with Pipeline(drive.sensor, config) as pipeline, pipeline.stream(drive) as results:
        for result in results:
            print(result.frame.name, *rows(result, config.detection.display_score), sep="\n  ")


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
