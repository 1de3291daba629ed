"""Fits that every calibration shares: estimates with standard errors, least squares, branches, growth, outliers."""
