"""Parts: which part of a recording swings freely, and which of its samples a fixed object or a stop cuts off.

In: samples and the windows through them. Out: the part with its windows. What is left out is a span with its kind.
"""
