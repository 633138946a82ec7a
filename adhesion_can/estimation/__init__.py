"""Samples in, estimates out: knows the physics, and neither bus nor clock."""
