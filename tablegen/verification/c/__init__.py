"""Play the C sequencer of a build: on this machine, or on an emulated Cortex-M."""
