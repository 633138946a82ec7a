"""The paper's three experiments, with every estimator."""
