"""State of a bus as somebody who watches it sees it, from its frames alone."""
