"""How often the tests of faults and damaged files try: DEEPMUON_THOROUGH times as often, once without that variable."""

from __future__ import annotations

import os

__all__ = ["TIMES"]

TIMES = int(os.environ.get("DEEPMUON_THOROUGH", "1"))
