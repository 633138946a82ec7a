"""Inference: detection, model selection, residual channels and hold-out gain."""
