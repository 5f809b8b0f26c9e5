"""`trifuse study`: the thesis' own studies and those of its claims, a picture and a table each."""

from benchmarks.studies import obstacle_commands, tracking_commands, training_commands

COMMANDS = {
    **obstacle_commands.COMMANDS,
    **tracking_commands.COMMANDS,
    **training_commands.COMMANDS,
}
