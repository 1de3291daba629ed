"""Floating-point arithmetic that gives the same bits on every machine.

The build is byte-identical everywhere, so whatever reaches an emitted word is computed from IEEE 754
basic operations alone (+, -, *, /, square root), in a fixed order. The trigonometry of the C library, vectorised
numpy kernels and LAPACK all differ in the last place from one processor to the next; here they are not used.
Complex products are avoided for the same reason: some builds fuse the multiplication with the addition.
"""
