"""Every output of the program for every kind of recording: no traceback, no internal error, nothing unreadable."""
