from sum_drake.seeds import derive


def test_purposes_and_seeds_have_streams_of_their_own_and_repeat():
    seeds = {derive(seed, purpose) for seed in range(20) for purpose in ("pouring", "detection", "planning")}
    assert len(seeds) == 60
    assert derive(3, "pouring") == derive(3, "pouring")
