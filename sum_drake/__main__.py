"""`python -m sum_drake`, for where the package can be imported but its command is not installed."""

import sys

from sum_drake.cli import main

if __name__ == "__main__":
    sys.exit(main())
