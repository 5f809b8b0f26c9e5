"""`trifuse study`: the thesis' own studies and those of its claims, a picture and a table each."""

from benchmarks.studies import detectors, moving_objects, obstacles

COMMANDS = {**obstacles.COMMANDS, **moving_objects.COMMANDS, **detectors.COMMANDS}
