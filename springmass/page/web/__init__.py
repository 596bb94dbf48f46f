"""The page on the network: its server, the rights to view and to act, limits for clients, and logging."""
