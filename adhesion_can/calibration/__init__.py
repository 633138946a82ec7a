"""Wheel radii and speed errors from coasting."""
