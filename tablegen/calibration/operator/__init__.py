"""Traces of a sensor -> an operator of the piezo; see docs/operator.md."""
