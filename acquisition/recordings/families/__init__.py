"""One module per family of recordings; families of text that differ only in their headings share ``dialects``."""
