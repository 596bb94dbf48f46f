"""One file a family of rangefinders."""
