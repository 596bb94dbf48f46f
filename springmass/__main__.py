"""``python -m springmass``."""

from springmass.cli import main

if __name__ == "__main__":
    raise SystemExit(main())
