"""Text and binary tables: their headings, channels and numbers, and the choice of a channel."""
