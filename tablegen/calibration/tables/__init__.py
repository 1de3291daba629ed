"""Read files of measurements: columns with units, and every input error at its line and column."""
