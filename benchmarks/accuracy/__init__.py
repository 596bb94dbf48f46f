"""Check the required accuracy of the estimates over many seeds."""
