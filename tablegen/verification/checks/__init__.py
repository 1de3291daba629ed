"""Checks of a build: its files, its certificate, and the playback."""
