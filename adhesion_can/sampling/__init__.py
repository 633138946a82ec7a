"""Samples of the adhesion curve from readings of different rates, frame by frame and in columns."""
