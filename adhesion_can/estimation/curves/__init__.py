"""Curves of any family fitted to samples, offline and online: points, fit, peak, scores."""
