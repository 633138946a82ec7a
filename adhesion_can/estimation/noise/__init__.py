"""Noise of the samples, estimated from the samples themselves."""
