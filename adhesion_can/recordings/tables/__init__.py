"""Tables of samples: what files of columns hold, and what each column means."""
