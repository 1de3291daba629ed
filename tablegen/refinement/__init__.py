"""A measured trace of the running scan to a layer over the model, by iterative learning with a stability bound.

The layer stands in the scan file, from where a build takes it, see ``tablegen.planning.refinement_layer``. Nothing
here reaches a word by another way: bits need not be the same on every machine.
"""
