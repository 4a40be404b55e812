"""Settings of the nodes that contradict each other, or are impossible."""

import math

import pytest

from upright.errors import UprightError
from upright.nodes.settings import LearnerSettings, SimulatorSettings
from upright.support.settings import ranges_of


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"policy": "p.npz", "save": "q.npz"}, "save is 'q.npz', but a policy that is played"),
        ({"policy": "p.npz", "from_policy": "q.npz"}, "either played .* or learned from"),
        ({"greedy": True}, "greedy is for a policy that is played"),
        ({"policy": "p.npz", "settings": "as-published"}, "settings is 'as-published', but a pol"),
        ({"from_policy": "p.npz", "settings": "as-published"}, "goes on from a policy has that"),
        ({"smoothing": 0.1}, "smoothing is 0.1, but velocities is 'measured'"),
        ({"homing_force": 1.0}, "homing_force is 1.0, but start_by is 'reset'"),
        (
            {"homing_force": 1.0, "start_by": "person", "velocities": "hidden"},
            "homing_force is 1.0, but velocities is 'hidden'",
        ),
        ({"still": 2.0}, "still is 2.0, but start_by is 'reset'"),
        ({"slider": "hinge"}, "slider is 'hinge' and hinge is 'hinge'; they must be the names of"),
        ({"command_gain": 0.0}, "command_gain is 0; it must be a factor"),
        ({"velocities": "guessed"}, "velocities is 'guessed'; it must be one of measured, diff"),
        ({"start_by": "dog"}, "start_by is 'dog'; it must be one of reset, person"),
        ({"task_parameters": "half_length=1"}, "parameter of a cart's task is 'half_length'; it"),
        ({"task_parameters": "force=-1"}, "force is -1.0; it must be"),
    ],
)
def test_a_learner_refuses_settings_that_contradict_each_other(settings, said):
    with pytest.raises(UprightError, match=said):
        LearnerSettings(**settings)


@pytest.mark.parametrize("kind", [LearnerSettings, SimulatorSettings])
@pytest.mark.parametrize("number", [-1, math.nan, math.inf, 10**20])
def test_numbers_out_of_range_are_refused(kind, number):
    names = [name for name, value in vars(kind()).items() if type(value) in (int, float)]
    ranges = ranges_of(kind())
    assert ranges.keys() == {*names}
    for name in names:
        if ranges[name][0] <= number <= ranges[name][1]:
            continue  # a gain may be negative
        with pytest.raises(UprightError, match=f"^{name} is "):
            kind(**{name: number})


@pytest.mark.parametrize("name", ["real_time_factor", "command_timeout"])
def test_a_simulator_in_lock_step_has_no_time_of_its_own(name):
    with pytest.raises(UprightError, match=f"{name} is 2.0, but .* lock_step must be false"):
        SimulatorSettings(**{name: 2.0})
    SimulatorSettings(**{name: 2.0}, lock_step=False)


@pytest.mark.parametrize("number", [math.inf, 1e308, -1e10])
def test_a_start_at_which_the_equations_overflow_is_refused(number):
    with pytest.raises(UprightError, match=r"^start_state is .* within ±1,000,000,000 or nan$"):
        SimulatorSettings(start_state=(0.0, 0.0, 0.0, number))
    SimulatorSettings(start_state=(0.0, 0.0, 0.0, math.nan))
