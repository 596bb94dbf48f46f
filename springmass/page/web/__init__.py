"""The bench page and the window on the network: their servers, and the rights to view and to act."""
