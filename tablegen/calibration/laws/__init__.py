"""Fits of measurements to the parameters of the laws (1)-(23) of the scanner file, one a module."""
