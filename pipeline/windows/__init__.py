"""Windows: the period, and amplitude, phase and rest position once per period.

The room contains the first estimate of the period from the spectrum, the linear fit of all windows and its passes.
"""
