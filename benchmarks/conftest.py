"""Which files of the benchmarks are no tests: the accuracy benchmark is a program of several modules."""

collect_ignore = ["accuracy"]
