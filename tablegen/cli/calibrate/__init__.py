"""The command ``tablegen calibrate``, one subcommand a file."""
