"""A library of scans in one directory: a folder each, one runtime, and an index in JSON, C and Verilog."""
