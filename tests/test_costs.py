import subprocess
import sys

from sum_drake.costs import Costs, peak_memory_mib


def test_costs_add_up_by_purpose():
    costs = Costs()
    for _ in range(2):
        with costs.of("a"):
            sum(range(200_000))
    with costs.of("b"):
        pass
    assert costs.seconds["a"] > costs.seconds["b"] >= 0.0


def test_what_fails_costs_too():
    costs = Costs()
    try:
        with costs.of("a"):
            raise RuntimeError
    except RuntimeError:
        pass
    assert "a" in costs.seconds


def test_peak_memory_is_of_the_process_itself_and_does_not_fall():
    """A parent's memory is not its children's, and what was given back was held all the same."""
    ballast = bytearray(300 * 2**20)
    code = (
        "from sum_drake.costs import peak_memory_mib\n"
        "before = peak_memory_mib()\n"
        "held = bytearray(100 * 2**20)\n"
        "held[:] = bytes([1]) * len(held)\n"
        "del held\n"
        "print(before, peak_memory_mib())"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    before, after = map(float, done.stdout.split())
    assert len(ballast) > 0
    assert before < 250
    assert after > before + 90
    assert peak_memory_mib() > before
