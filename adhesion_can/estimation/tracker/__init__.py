"""The default estimator: a Bayesian tracker of the curve with run-length change detection."""
