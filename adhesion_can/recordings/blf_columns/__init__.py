"""Vector's binary logs (.blf) in columns: objects out of containers, many parsed at a time."""
