"""Estimation with an extended model: a base curve with effects on top of it."""
