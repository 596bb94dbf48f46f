"""Read ports and turn their bytes into samples; runs are rebuilt from logs by this code, so it must stay bit-exact."""
