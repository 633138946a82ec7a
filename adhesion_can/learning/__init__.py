"""A service that learns what its curve does not hold, from its own readings."""
