"""Views of a bus for a terminal: pure functions from a snapshot to lines of a given width."""
