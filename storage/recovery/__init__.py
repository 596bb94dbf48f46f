"""Recovery: build run files from a wire log, even a damaged one, and count what the recording lost.

In: a log on the disk. Out: run files that were verified against it, and the losses. You may change how the samples are
built, but every byte of the log must stay inside the run file.
"""
