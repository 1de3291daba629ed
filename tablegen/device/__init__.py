"""The integer model of a device: its schedule, its registers and its sequencer. Integers alone; it imports no plan."""
