"""Charts as data, and their drawing: SVG, PNG and PDF by matplotlib, and characters for a terminal."""
