"""Learning while the service runs: a model of what the instruments or the rail do is proposed.

A child process of the lowest priority keeps a record of the readings, diagnoses it, and confirms on
later readings what it found. Nothing in the service depends on it.
"""
