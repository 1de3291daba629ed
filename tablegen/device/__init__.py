"""The integer model of a device: its schedule, its registers and its sequencer. It uses integers only, and no plan."""
