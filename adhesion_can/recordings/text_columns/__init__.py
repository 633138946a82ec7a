"""Text with a frame a line (candump, .asc, .trc) in columns, by learnt layouts of its lines."""
