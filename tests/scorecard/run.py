"""What the package promises, measured: ``python tests/scorecard/run.py NAME [--full] [--write]``."""

import sys
from pathlib import Path

import card

if __name__ == "__main__":
    sys.exit(card.main("scorecard", Path(__file__).parent))
