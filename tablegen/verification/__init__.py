"""Compare what a build's sequencer plays, in C or in Verilog, with the model and the float waveform."""
