"""Text traces of other tools (.asc, .trc) in columns: lines by learnt layouts."""
