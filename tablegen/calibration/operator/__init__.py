"""Fit an operator of the piezo to traces of a sensor; see docs/operator.md."""
