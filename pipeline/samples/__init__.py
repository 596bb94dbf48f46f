"""Samples: which of them a fit may use, and whether rows were lost, duplicated or out of order.

Every sample keeps its place; a flag states what is wrong with it.
"""
