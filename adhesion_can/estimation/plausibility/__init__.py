"""Plausibility of the readings, between signals and from one cycle to the next, in front of any
estimator.
"""
