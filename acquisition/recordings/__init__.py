"""Recordings of other programs: identify a file, read its tables, choose a channel, and return its samples."""
