"""Q-learning in C, as Octave calls it, makes the run that the package makes."""

from dataclasses import asdict, replace
from itertools import product
from typing import Any

import numpy as np
import pytest
from helpers import make_task
from octave import HAS_COMPILER, octave

from upright.agents.q_learning import SETTINGS
from upright.core.conditions import NOISES
from upright.core.loops import compiled_run
from upright.plants.equations import equations
from upright.studies.random_streams import twister

DEFAULT, PUBLISHED = SETTINGS["default"], SETTINGS["as-published"]
OTHERS = (
    replace(DEFAULT, mirrored=False),
    replace(PUBLISHED, mirrored=True),
    # Some measurements uncut, and a ring of moves that overflows at once.
    replace(
        DEFAULT,
        mirrored=False,
        replay_size=7,
        replay_passes=3,
        jitter=0.3,
        x_edges=(),
        theta_edges=(0.01,),
    ),
)
TASKS = list(product((DEFAULT, PUBLISHED), NOISES, ("random",), (1, 2**32 - 1))) + list(
    product(OTHERS, ("none", "all-10"), ("zero",), (0, 7))
)


def in_octave(value: Any) -> str:
    """Return a number, a tuple of them, or a dictionary in Octave's language, to the last bit."""
    if isinstance(value, dict):
        fields = [f"'{name}', {in_octave(each)}" for name, each in value.items()]
        return f"struct({', '.join(fields)})"
    if isinstance(value, tuple):
        return f"[{' '.join(map(in_octave, value))}]"
    return repr(value).lower()


@pytest.mark.octave
@pytest.mark.skipif(not HAS_COMPILER, reason="octave-dev or gcc is not installed")
def test_the_mex_function_makes_the_same_runs_to_the_last_bit(tmp_path):
    script = [f"upright.build_mex('{tmp_path}'); addpath('{tmp_path}');"]
    expected = []
    for settings, noise, start, number in TASKS:
        task = make_task(noise, start, steps=2000, trials=100)
        rng = twister(number)
        agent = settings.agent(rng)
        lengths = np.zeros(task.trials, np.int64)
        stop = np.zeros(1, np.bool_)
        success = compiled_run(agent, equations(task.parameters), task, rng, lengths, stop)
        expected.append([*lengths[lengths > 0], success > 0, *agent.table])
        given = (task.parameters._asdict(), task.noise._asdict(), tuple(task.start))
        given += (asdict(settings), number, task.steps, task.trials)
        values = ", ".join(map(in_octave, given))
        script.append(f"[lengths, balanced, table] = q_learning_mex({values});")
        script.append("printf('%.17g ', lengths, balanced, table); printf('\\n');")
    built, *lines = octave("\n".join(script)).splitlines()
    assert built.startswith("built ")
    for case, line, numbers in zip(TASKS, lines, expected, strict=True):
        assert list(map(float, line.split())) == numbers, case
