"""Points on computed and on measured contacts of wheel and rail, as samples."""

import csv
from dataclasses import replace

import numpy as np
from scipy.interpolate import PchipInterpolator

from adhesion_can.physics.samples import Samples

SPEED, LOAD = 10.0, 213_400.0
"""Vehicle speed, m/s, and wheelset load, N, of the Eurosprinter's curves and points."""

PEAKS = {"contact_extended": (0.3117, 0.016), "fastsim_modified": (0.3042, 0.022)}
"""Highest point (μ, λ) of each computed curve in its file."""


def computed_curve(folder, model):
    """Adhesion as a function of slip, by monotone cubic interpolation."""
    with (folder / "contact_curves.csv").open() as file:
        rows = [row for row in csv.DictReader(file) if row["model"] == model]
    return PchipInterpolator(*(np.array([float(r[c]) for r in rows]) for c in ("slip", "adhesion")))


def points(slip, adhesion, slip_var=0.0):
    """Samples without a time at the Eurosprinter's speed and load."""
    samples = Samples.curve(slip, adhesion)
    ones = np.ones(len(samples))
    return replace(
        samples,
        speed=SPEED * ones,
        creep_speed=SPEED * samples.slip,
        load=LOAD * ones,
        slip_var=slip_var * ones,
    )
