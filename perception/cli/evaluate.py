"""`trifuse evaluate`: every stage against labels or exact truth."""

from perception.cli.evaluations.otd import otd

COMMANDS = {"otd": otd}
