"""The rangefinder's firmware under an emulator."""
