"""Read ports and turn their bytes into samples.

``timebase`` and ``decoding`` also reconstruct every recorded run from its log, so future versions must give
bit-identical results.
"""
