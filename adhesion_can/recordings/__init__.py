"""Recordings of any format as frames and columns, and tables of samples."""
