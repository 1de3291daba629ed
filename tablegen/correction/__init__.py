"""Images that were already taken, put straight: by the scanner file, or by a fit to a periodic sample."""
