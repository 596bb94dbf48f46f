"""Recovery: from a wire log, however torn, to run files, and what the recording did not get.

In: a log on the disk. Out: run files verified against it, the losses counted. A newcomer may change how the samples are
built up; that every byte of the log travels inside the run file may not change.
"""
