"""Commands that read images: ``channels``, ``correct``, ``refine``."""
