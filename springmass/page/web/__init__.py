"""The page on the network: its server, who may look and who may act, what a client may take, and what is logged."""
