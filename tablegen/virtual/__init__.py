"""A virtual scanner on which scans are simulated; none of its models is the one that a build inverts."""
