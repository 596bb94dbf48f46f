"""Decoders: one file per family of rangefinders, and shared modules that cut streams into frames."""
