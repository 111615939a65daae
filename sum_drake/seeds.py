"""One seed a run, one stream a purpose."""

import hashlib


def derive(seed: int, purpose: str) -> int:
    """A seed for one purpose of a run: its stream is its own, and a new purpose disturbs no old one."""
    digest = hashlib.sha256(f"{seed}:{purpose}".encode()).digest()
    return int.from_bytes(digest[:4], "little")
