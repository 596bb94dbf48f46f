"""Samples: which of them a fit may use, whether rows are duplicated or out of order, and how large the noise is.

Every sample keeps its place; a flag states what is wrong with it.
"""
