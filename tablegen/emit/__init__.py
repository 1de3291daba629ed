"""The plan as files: every emitter formats integers that were computed before, and computes none."""
