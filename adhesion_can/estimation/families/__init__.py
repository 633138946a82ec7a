"""Curve families weighed against each other online, from binned samples."""
