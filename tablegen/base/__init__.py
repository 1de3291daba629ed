"""Foundations: input errors, warnings, bounded reading, TOML with lines, locks, workers."""
