"""Regression: the model of the data, whitening, Gram matrices and fits."""
