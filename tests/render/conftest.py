"""What the scorecards run a function of one lane with, for tests of a few points."""

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1] / "scorecard"))
