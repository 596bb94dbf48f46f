"""One file a family of recordings (MotionSensor.vi: a folder); ``template`` is the recipe for another.

In: the bytes of a file. Out: why it is of the family, and what stands where in it; ``tables`` reads the numbers.
A newcomer copies ``template`` and adds a line to ``identify``; no family imports another but to yield a file to it.
"""
