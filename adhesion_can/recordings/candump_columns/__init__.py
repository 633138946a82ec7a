"""candump text in columns: chunks of lines parsed by learnt layouts."""
