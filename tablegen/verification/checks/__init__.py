"""Check a build: its files, its certificate, and what was played."""
