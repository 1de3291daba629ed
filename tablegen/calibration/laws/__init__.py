"""One fit a file: measurements to the parameters of the laws (1)-(23) of the scanner file."""
