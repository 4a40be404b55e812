"""Custom agents are built as the package's own are, or refused with the reason."""

import json
import subprocess
from pathlib import Path

import pytest

from upright.agents.starters import starter
from upright.builds.learner import build_learner
from upright.builds.wasm import WASM
from upright.builds.web_package import build_web
from upright.errors import UprightError
from upright.studies.case import make_case
from upright.studies.run import make_run

HERE = Path(__file__).parent
SHORT = {"steps": 3000, "trials": 25}
AGENT = """
    import math
    from typing import NamedTuple

    import numpy as np

    import upright


    class Guess(NamedTuple):
        weight: np.ndarray

        @upright.compiled
        def begin_run(self, rng):
            self.weight[0] = rng.random()

        @upright.compiled
        def begin_trial(self, rng):
            self.weight[0] += 0.1 * rng.random()

        @upright.compiled
        def act(self, observation, rng):
            return observation[2] + self.weight[0] * observation[3] > 0.0

        @upright.compiled
        def learn(self, before, action, after, fallen):
            pass

        @upright.compiled
        def end_trial(self, fallen):
            pass


    def make(rng):
        agent = Guess(np.zeros(1))
        agent.begin_run(rng)
        return agent
"""


@pytest.mark.slow
@pytest.mark.wasm
@pytest.mark.parametrize("begins", [True, False], ids=["draws", "starter"])
def test_a_custom_agent_learns_the_same_in_node(write, tmp_path, begins):
    if begins:
        name = f"{write(AGENT)}:make"
    else:
        agent, text = starter("my_agent", compiled=True)
        name = f"{write(text)}:{agent}"
    (module,) = build_web([make_case(name, **SHORT)], tmp_path / "page")
    assert module.name == f"{name.replace(':', '.')}.wasm"
    command = ["node", str(HERE / "proof_in_node.mjs"), str(module.parent), module.stem, '["none"]']
    done = subprocess.run([*command, '{"seed": 4}'], capture_output=True, text=True, check=True)
    (found,) = json.loads(done.stdout)
    _, result = make_run(make_case(name, **SHORT), 4, 0)
    assert found["lengths"] == result.lengths.tolist()
    assert len(set(found["lengths"])) > 1


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ("def begin_run(self, rng)", "def begin_it(self, rng)", "it draws random numbers when"),
        ("agent.begin_run(rng)", "rng.random(); agent.begin_run(rng)", "does not leave the agent"),
        (
            "@upright.compiled",
            "",
            "it is plain Python, and only an agent whose methods are compiled",
        ),
        ("0.1 * rng.random()", "math.exp(rng.random())", "it calls exp of the C library"),
        ("0.1 * rng.random()", "np.zeros(3)[0]", "it allocates an array"),
    ],
)
def test_what_cannot_be_built_is_refused(write, old, new, why):
    text = AGENT.replace(old, new)
    if "begin_it" in new:
        text = text.replace("agent.begin_run(rng)", "agent.weight[0] = rng.random()")
    name = f"{write(text)}:make"
    with pytest.raises(UprightError, match=rf"agent is '{name}'.*{why}") as error:
        build_learner(make_case(name, **SHORT), WASM)
    assert "\n" not in str(error.value)


def test_a_plant_of_each_run_is_refused(tmp_path):
    with pytest.raises(UprightError, match="condition is 'varied-plant'; each run has its own"):
        [*build_web([make_case("q-learning", condition="varied-plant")], tmp_path)]


def test_two_modules_of_one_name_are_refused(tmp_path):
    cases = [make_case("q-learning"), make_case("q-learning", "as-published")]
    with pytest.raises(UprightError, match="there would be several modules of its name"):
        [*build_web(cases, tmp_path)]


def test_a_folder_that_cannot_be_made_is_reported(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(UprightError, match="file/page'; the folder cannot be created: Not a dir"):
        [*build_web([make_case("q-learning")], tmp_path / "file" / "page")]
