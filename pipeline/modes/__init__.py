"""Modes: other oscillations beside the main one, their search in the spectrum, and the samples without them."""
