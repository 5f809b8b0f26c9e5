"""`trifuse evaluate`: every stage against labels or exact truth."""

from perception.cli.evaluations.otd import otd
from perception.cli.evaluations.tracks import tracks

COMMANDS = {"tracks": tracks, "otd": otd}
