"""Exclude benchmark files that are not tests, and restore the default handling of Ctrl-C."""

import signal

collect_ignore = ["accuracy"]  # a program of several modules

# A background job starts with Ctrl-C ignored, and the programs that are interrupted in these tests would inherit this.
signal.signal(signal.SIGINT, signal.default_int_handler)
