"""What a build promises: errors of every emitted integer, the limits on them, and all of it in words."""
