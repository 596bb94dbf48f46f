"""One module per program or format of file that makes recordings; ``user_dialects`` has those that a user declares."""
