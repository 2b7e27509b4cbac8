"""Whether DeepMuon can be trusted: campaigns of faults, damaged files and repetitions."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2] / "tests"))  # whose helpers damage files and run commands
