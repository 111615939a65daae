"""Detectors: p(b | z) and p(o | b, z) of eq. 3."""
