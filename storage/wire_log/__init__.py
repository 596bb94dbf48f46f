"""The wire log: every byte off the wire, kept while a run is recorded.

In: records (reads, marks, events), appended and never changed. Out: every sound record of a log, whatever happened to
the file around it, an account of what is missing, and the samples that the bytes decode to.
To change: what an event says. The layout in ``records`` is fixed: logs of every version so far must stay readable.
"""
