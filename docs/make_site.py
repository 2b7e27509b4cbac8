"""Builds the site: ``python docs/make_site.py [FOLDER]``, into docs/_build if no folder is named.

Warnings are errors. npm brings what the live page runs on; nothing is downloaded while reading the site.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

DOCS = Path(__file__).parent


def main() -> None:
    """Get what npm brings, then run Sphinx."""
    site = sys.argv[1] if len(sys.argv) > 1 else str(DOCS / "_build")
    npm = shutil.which("npm")
    if npm is None:
        sys.exit(
            "docs/make_site.py: npm was not found, and brings what the live page runs on: install Node.js 20 or newer"
        )
    run(npm, "ci", "--no-fund", "--no-audit")
    run(npm, "run", "build")
    run(sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", str(DOCS), site)
    print(f"the site is in {site}")


def run(*command: str) -> None:
    """Run a program in the repository; end with its exit code if it fails."""
    status = subprocess.run(command, cwd=DOCS.parent).returncode
    if status != 0:
        sys.exit(status)


if __name__ == "__main__":
    main()
