"""Sessions that exercise a sequencer, and the capture of what it plays."""
