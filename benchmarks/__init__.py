"""Benchmark programs, and tests that each of them runs."""
