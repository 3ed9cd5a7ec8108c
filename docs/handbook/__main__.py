"""`python -m docs.handbook README.md docs` renews the generated parts in the files named and in
every page of a folder named."""

import sys
from pathlib import Path

from .pages import renew

if __name__ == "__main__":
    renew(map(Path, sys.argv[1:]))
