"""Tables of samples: what files of columns hold, and which column is what."""
