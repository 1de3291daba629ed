"""Images of a scanning microscope: reading, levelling, and the lattice or grating in them."""
