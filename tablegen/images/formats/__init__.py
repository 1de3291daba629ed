"""Readers of image files, one format a module: bytes to channels, without trust in what the bytes say."""
