"""Plausibility of the readings, between signals and over time, in front of any estimator."""
