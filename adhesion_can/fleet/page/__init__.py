"""Page of a fleet: its vehicles, what they share, their sizes, and adhesion by line and day."""
