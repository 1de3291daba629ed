"""Calibration: measurements of a laboratory to a scanner file, one measurement a file, with standard errors.

Needs the extra ``calibrate``. Each fit is a plain function of arrays; ``tables/table.py`` reads them from CSV,
``scanner_file.py`` writes the results.
"""
