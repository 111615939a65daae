from hypothesis import given
from hypothesis import strategies as st

from sum_drake.detection.sigma_c import sigma_c_rule

CONFIDENCES = st.dictionaries(st.sampled_from("abcdefgh"), st.floats(1e-6, 1.0), min_size=1).map(
    lambda d: list(d.items())
)


def test_labels_within_the_ratio_of_the_best_stay():
    p_labels = [("tide", 0.05), ("mug", 0.8), ("sugar", 0.09)]
    assert sigma_c_rule(p_labels, 0.1) == (("mug", 0.8), ("sugar", 0.09))
    assert sigma_c_rule(p_labels, 0.5) == (("mug", 0.8),)


@given(p_labels=CONFIDENCES, sigma_c=st.floats(0.001, 0.999))
def test_the_best_stays_and_the_order_is_by_confidence(p_labels, sigma_c):
    kept = sigma_c_rule(p_labels, sigma_c)
    best = max(p for _, p in p_labels)
    assert kept[0][1] == best
    assert [p for _, p in kept] == sorted((p for _, p in kept), reverse=True)
    assert set(kept) == {(label, p) for label, p in p_labels if p >= sigma_c * best}


@given(p_labels=CONFIDENCES, sigma_c=st.floats(0.001, 0.999))
def test_the_order_of_labels_does_not_matter(p_labels, sigma_c):
    assert sigma_c_rule(p_labels, sigma_c) == sigma_c_rule(p_labels[::-1], sigma_c)
