"""Recovery: build run files from a wire log, even a damaged one, and count the losses of the recording.

In: a log on the disk. Out: run files that were verified against the log, and the losses. Free to change: the way the
samples are built, but the run file must contain every byte of the log.
"""
