"""The plan as files: every emitter renders integers that were made once, and computes nothing."""
