"""Turn printed columns into samples: times on their grid, flags, and remarks; no value is changed."""
