"""What the estimates must reach, measured over many seeds."""
