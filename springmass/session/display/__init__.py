"""What a recording shows while it runs, where it can neither delay nor end it.

In: blocks of samples and the recorder's status. Out: about once a second a Progress, given to whoever shows it.
Free to change: what is shown. Whatever fails here is counted and written into the run, and the recording goes on.
"""
