"""Correction of existing images: by the scanner file, or by a fit to a periodic sample."""
