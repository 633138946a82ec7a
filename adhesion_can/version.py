"""Version of the package, for every output."""

__version__ = "0.1.0"
