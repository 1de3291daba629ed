"""``manifest.json``: a build as plain data, written and read; the reader knows nothing of how it was made."""
