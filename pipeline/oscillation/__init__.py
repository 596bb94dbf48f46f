"""From samples to amplitude, phase and rest position against time.

In comes a Track. Out come its samples judged (Conditioned), where its periods lie (Cycles), one point a window with
covariance (Demodulated), and what the record holds beside the oscillation (Disturbances), each with that taken out.
A newcomer may add a kind of disturbance: a module that finds it and says what it adds to the distance, called by
``disturbances.separate``; the windows' fit and the false-alarm rates are held by ``make trials``.
"""
