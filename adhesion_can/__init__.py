"""adhesion-can: the wheel/rail adhesion curve, identified online from a CAN bus."""

__version__ = "0.1.0"
