"""Hold what streams out of the Verilog sequencer against model and float waveform; needs the extra ``hdl``."""
