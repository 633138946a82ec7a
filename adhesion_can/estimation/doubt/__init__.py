"""Doubt: whether the model in use explains the residual, and what it may be wrong by if not."""
