"""Half-widths of intervals of a normal distribution, in its standard deviations."""

NORMAL_90 = 1.645
"""90 % interval. A rounded number: the intervals in setpoints are sent, and their bytes stay."""
NORMAL_95 = 1.959964
"""95 % interval."""
