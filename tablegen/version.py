"""The version, below everything else: pyproject.toml, manifests and headers take it from here."""

__version__ = "0.3.0"
