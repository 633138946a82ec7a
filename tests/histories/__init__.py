"""Histories: runs of the service on a bus in simulated time, with faults drawn at random.

`traffic` makes the frames and spoils them, `simulated_bus` is the bus with its clock, `play` runs
the service on it. `checker` judges the record of the bus beside the schedule of faults, and knows
nothing else of the service. A schedule that fails is shrunk to the fewest faults that still do.
"""
