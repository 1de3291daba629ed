"""Build a library of scans: what is missing or has changed, in parallel, and its index."""
