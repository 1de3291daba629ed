"""Certificates of a build: errors of every emitted integer, the limits on them, and all of it in words."""
