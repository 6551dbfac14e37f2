"""How long it takes: ``python tests/benchmarks/run.py NAME [--full] [--json FILE]``."""

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1] / "scorecard"))

import card

if __name__ == "__main__":
    sys.exit(card.main("benchmarks", Path(__file__).parent))
