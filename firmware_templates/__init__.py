"""Templates of what tablegen emits, and the static runtime that plays it."""
