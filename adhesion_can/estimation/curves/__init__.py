"""Curves of any family fitted to samples: points, fit, peak, and scores of families."""
