"""One file a family of rangefinders, and the few modules that cut streams into frames for all of them.

In: the bytes of one read of a port, however the stream was cut. Out: readings, and counts of what was none.
To add: a family, from ``example.py`` and with one line in ``registry.py``. ``lines``, ``sum_frames``, ``replies``,
``cycle``, ``columns`` and ``rows`` are shared: a change to one of them is a change to several families.
"""
