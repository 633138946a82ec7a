"""What a person reads: tables and sentences made of results."""
