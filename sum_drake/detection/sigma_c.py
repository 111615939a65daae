"""Which labels of a box are worth a hypothesis."""

from collections.abc import Sequence


def sigma_c_rule(p_labels: Sequence[tuple[str, float]], sigma_c: float) -> tuple[tuple[str, float], ...]:
    """Labels whose confidence is at least sigma_c times the box's largest (Sui et al. 2017, eq. 5), likeliest first."""
    ordered = sorted(p_labels, key=lambda pair: (-pair[1], pair[0]))
    return tuple((label, p) for label, p in ordered if p >= sigma_c * ordered[0][1])
