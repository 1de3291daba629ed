"""Comparison of two scans, builds or calibrations: their numbers, the differences, and overlaid charts."""
