"""Logs of other tools that have a line a frame: one table of their forms, one reader."""
