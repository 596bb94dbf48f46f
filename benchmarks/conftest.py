"""Which files of the benchmarks are no tests, and Ctrl-C as a terminal leaves it."""

import signal

collect_ignore = ["accuracy"]  # a program of several modules

# A job in the background is started with Ctrl-C ignored, and hands that on to the programs that are interrupted here.
signal.signal(signal.SIGINT, signal.default_int_handler)
