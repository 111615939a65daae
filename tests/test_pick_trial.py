"""The station with a robot that is told where everything is."""

import numpy as np
from scenes import standing

from sum_drake.objects import load_catalogue
from sum_drake.systems.pick_trial import run_picks
from sum_drake.systems.scenario import load_scenario
from sum_drake.task import Look, Stop

CATALOGUE = load_catalogue()
SCENARIO = load_scenario(catalogue=CATALOGUE)


def test_it_is_told_the_true_poses_each_time_and_stops_when_it_says_so():
    X_WO, told = standing(CATALOGUE, "sugar", 0.6, 0.1), []

    def decide(X_WOs, attempts, q):
        told.append(X_WOs)
        return Look(()) if len(told) < 3 else Stop("cleared", ())

    trial = run_picks(SCENARIO, CATALOGUE, {"sugar": X_WO}, decide=decide, retreat=None, carry_on=None, shake=None)
    assert trial.outcome == "cleared" and trial.attempts == ()
    assert len(told) == 3 and all(set(X_WOs) == {"sugar"} for X_WOs in told)
    np.testing.assert_allclose(told[-1]["sugar"], X_WO, atol=2e-3)
    assert trial.sim_time_s < 4.0
    assert trial.use.samples > 250 and trial.use.violated == 0


def test_what_goes_wrong_while_deciding_ends_the_trial_and_is_told():
    def decide(X_WOs, attempts, q):
        raise RuntimeError("no idea")

    trial = run_picks(
        SCENARIO,
        CATALOGUE,
        {"sugar": standing(CATALOGUE, "sugar", 0.6, 0.1)},
        decide=decide,
        retreat=None,
        carry_on=None,
        shake=None,
    )
    assert trial.outcome == "stopped: failed: RuntimeError: no idea"
    assert trial.truth and trial.use.samples > 0


def test_time_is_limited():
    trial = run_picks(
        SCENARIO,
        CATALOGUE,
        {},
        decide=lambda X_WOs, attempts, q: Look(()),
        retreat=None,
        carry_on=None,
        shake=None,
        duration=0.3,
    )
    assert trial.outcome == "stopped: 0.3 s of simulated time are over"
