"""Drive data: rows of one recording or table on which the model equations are written."""
