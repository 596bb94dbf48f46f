"""One file a family of recordings."""
