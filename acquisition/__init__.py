"""Turn bytes from a port or a recording into blocks of samples; no other package of the project is imported."""
