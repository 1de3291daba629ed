"""Compensated scan waveforms for piezo scanners, as fixed-point tables in C and Verilog.

The data flow is one way::

    scanner.toml + scan.toml -> config -> compensation -> waveform -> fixedpoint -> plan -> emit
                                                                                    |-> sequencer, certificate
"""

__version__ = "0.2.0"
