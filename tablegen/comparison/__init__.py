"""Two scans, builds or calibrations side by side: their numbers, what differs, and overlaid charts."""
