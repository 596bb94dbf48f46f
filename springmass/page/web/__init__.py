"""The page on the network: its server, and the rights to view and to act."""
