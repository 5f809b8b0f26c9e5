"""`trifuse evaluate`: every stage against labels or exact truth."""

from perception.cli.evaluations.datmo import datmo
from perception.cli.evaluations.otd import otd
from perception.cli.evaluations.tracks import tracks
from perception.cli.evaluations.vehicles import vehicles

COMMANDS = {
    "datmo": datmo,
    "tracks": tracks,
    "otd": otd,
    "vehicles": vehicles,
}
