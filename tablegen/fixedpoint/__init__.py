"""The arithmetic of the project: every emitted integer is made here, and C and Verilog equal it on every sample.

Functions that play samples take and return 64-bit integers (numpy arrays or Python ints alike); the bound that
keeps each product inside them stands beside it. ``docs/sequencer.md`` states the same in prose.
"""
