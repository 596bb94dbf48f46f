"""The wire log: every byte received from the sensors, stored while a run is recorded.

In: records (reads, marks, events), appended and never changed. Out: every valid record of a log, even if the file
around it is damaged; the counts of missing records; and the samples decoded from the bytes. Free to change: the
content of events. The layout in ``records`` is fixed: logs of all previous versions must remain readable.
"""
