"""Worlds by others: mechanisms from the literature, written down from its formulas alone.

`python -m tests.worlds.outside` lists them. They share nothing with the library that must judge
them, and no constant of theirs was chosen by what it answers.
"""
