"""Play the Verilog sequencer of a build in a simulator."""
