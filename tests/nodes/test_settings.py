"""Settings of the nodes that contradict each other."""

import pytest

from upright.errors import UprightError
from upright.nodes.settings import LearnerSettings


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"policy": "p.npz", "save": "q.npz"}, "save is 'q.npz', but a policy that is played"),
        ({"policy": "p.npz", "from_policy": "q.npz"}, "either played .* or learned from"),
        ({"greedy": True}, "greedy is for a policy that is played"),
    ],
)
def test_a_learner_refuses_settings_that_contradict_each_other(settings, said):
    with pytest.raises(UprightError, match=said):
        LearnerSettings(**settings)
