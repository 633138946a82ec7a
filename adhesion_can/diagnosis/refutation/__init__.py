"""Refutation of causes: what a cause leaves in blocks of time, and whether its size is one size.

A gain on held-out data of the same drive shows that a model predicts, not that it names the cause.
A cause must survive two attempts to refute it: `block_variance` and `invariance`. `refute` makes
both, and says in a sentence why a cause failed.
"""
