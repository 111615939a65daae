"""What a run costs, by purpose."""

import time
from collections.abc import Iterator
from contextlib import contextmanager


class Costs:
    """CPU seconds by purpose."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    @contextmanager
    def of(self, purpose: str) -> Iterator[None]:
        """Adds the CPU time of the block."""
        start = time.process_time()
        try:
            yield
        finally:
            self.seconds[purpose] = self.seconds.get(purpose, 0.0) + time.process_time() - start
