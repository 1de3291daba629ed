"""A virtual scanner to try a scan on. It is a simulation, and none of its models is the one that a build inverts."""
