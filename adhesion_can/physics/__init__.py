"""Physics of the wheel/rail contact: pure functions and frozen data, SI units, no I/O."""
