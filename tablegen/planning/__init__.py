"""From a checked configuration to one immutable plan: the ticks, what is feasible, the integers of each axis."""
