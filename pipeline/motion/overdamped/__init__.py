"""Overdamped motion: records in which damping ends the motion before, or almost before, it can oscillate.

In: a conditioned record. Out: rates or frequency, the damping ratio, and how stiff the spring is; or that it is no such
motion. A newcomer may add a shape that such a motion could be mistaken for, in ``search``, or what follows from its
rates, in ``estimates``.
"""
