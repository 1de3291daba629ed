"""Calibration: from what a laboratory can measure to a scanner file, one measurement a file, with standard errors.

Needs the extra ``calibrate``. Each fit is a plain function of arrays; ``table.py`` reads them from CSV,
``scanner_file.py`` writes what came out.
"""
