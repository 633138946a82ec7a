"""Many recordings on many machines: units of work, their data set, and the fleet's diagnosis."""
