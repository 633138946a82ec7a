"""What the simulation gets wrong, why, how it must be extended, and what that gains."""
