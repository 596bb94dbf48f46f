"""From a port or an old file to blocks of samples; knows nothing of the rest."""
