"""The manifest of a build, ``manifest.json``: plain data, written and read; the reader knows nothing of the build."""
