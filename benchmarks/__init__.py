"""What is measured, as programs, and tests that each of them runs."""
