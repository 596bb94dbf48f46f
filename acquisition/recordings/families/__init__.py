"""One file per family of recordings (a folder for MotionSensor.vi); ``template`` shows how to add one.

In: the bytes of a file. Out: why it belongs to the family, and the layout of its content; ``tables`` reads the numbers.
To add a family, copy ``template`` and add a line to ``identify``. A family imports another only to leave files to it.
"""
