"""Samples: which of them a fit may use, and whether rows were lost, doubled or mixed.

Every sample keeps its place; what is wrong with it is a flag.
"""
