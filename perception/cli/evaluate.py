"""`trifuse evaluate`: every stage against labels or exact truth."""

from perception.cli.evaluations.depthcn import depthcn
from perception.cli.evaluations.detection import detection
from perception.cli.evaluations.detector import detector
from perception.cli.evaluations.fusion import fusion
from perception.cli.evaluations.otd import otd
from perception.cli.evaluations.robustness import robustness
from perception.cli.evaluations.tracks import tracks

COMMANDS = {
    "tracks": tracks,
    "otd": otd,
    "detection": detection,
    "depthcn": depthcn,
    "detector": detector,
    "fusion": fusion,
    "robustness": robustness,
}
