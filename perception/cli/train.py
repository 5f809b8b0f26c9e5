"""`trifuse train`: what is fitted to labelled drives: settings of the proposals, and networks."""

from perception.cli.training.depthcn import depthcn
from perception.cli.training.detector import detector
from perception.cli.training.fusion import fusion
from perception.cli.training.proposals import proposals

COMMANDS = {"proposals": proposals, "depthcn": depthcn, "detector": detector, "fusion": fusion}
