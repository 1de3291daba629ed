"""Code that several commands share: exit statuses, terminal output, plots, the path from a file to a certified plan."""
