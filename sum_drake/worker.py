"""A process that does one thing for another and ends with it: `python -m sum_drake.worker MIB COMMAND...`.

Its standard input is a pipe that whoever started it holds open. When that ends, however it is killed, so does this, and
nothing runs on that nobody waits for. MIB: memory it may have, mebibytes.
"""

import os
import resource
import sys
import threading

from sum_drake.cli import main


def _end_with_the_pipe() -> None:
    while os.read(0, 1):
        pass
    os._exit(1)


if __name__ == "__main__":
    asked, (_, hard) = int(sys.argv[1]) << 20, resource.getrlimit(resource.RLIMIT_DATA)
    limit = asked if hard == resource.RLIM_INFINITY else min(asked, hard)  # nobody may raise what was lowered
    resource.setrlimit(resource.RLIMIT_DATA, (limit, limit))
    threading.Thread(target=_end_with_the_pipe, daemon=True).start()
    sys.exit(main(sys.argv[2:]))
