"""Functions and results of ``import tablegen``: for scripts, notebooks, and the commands themselves."""
