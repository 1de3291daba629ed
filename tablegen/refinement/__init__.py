"""Refinement: from a measurement of the running scan to a layer over the model, by stable iterative learning.

The layer stands in the scan file, from where a build takes it, see ``tablegen.planning.refinement_layer``. A layer
changes an emitted word in no other way, so that its own arithmetic may differ from one machine to another.
"""
