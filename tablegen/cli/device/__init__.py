"""Commands that talk to a device over a serial port."""
