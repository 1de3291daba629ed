"""From a validated configuration to one immutable plan: ticks, checks of feasibility, integers of each axis."""
