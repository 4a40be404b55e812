"""Modules for browsers, run by Node.js: every bit is that of the same run here."""

import base64
import json
import subprocess

import numpy as np
import pytest

from upright.agents import AGENTS
from upright.builds.learner import build_learner
from upright.builds.wasm import WASM, link
from upright.core.conditions import NOISES, noise_of
from upright.core.trials import FAILED, SUCCEEDED
from upright.errors import UprightError
from upright.policies.npz_file import arrays_of
from upright.studies.case import make_case
from upright.studies.run import make_run

SHORT = {"steps": 3000, "trials": 25}
SEED, RUN = 7, 3
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def learner(tmp_path_factory):
    """Return a function that builds the module of an agent once, into a folder."""
    folders = {}

    def learner_of(name):
        if name not in folders:
            folder = folders[name] = tmp_path_factory.mktemp(name)
            built = build_learner(make_case(name, **SHORT), WASM)
            code = link(built.code, ("begin", "seed", "advance", "push_probability"))
            (folder / "learner.wasm").write_bytes(code)
            places = {p.name: (p.offset, p.dtype.str) for p in built.memory.places.values()}
            text = json.dumps({"size": built.memory.size, "places": places})
            (folder / "places.json").write_text(text)
            folders[name] = folder, built.memory
        return folders[name]

    return learner_of


def run_in_node(folder, noise):
    numbers = {f"task.noise.{name}": value for name, value in noise_of(noise)._asdict().items()}
    program = ["node", str(__file__).replace("test_learner.py", "learner.mjs")]
    command = [*program, str(folder), str(SEED), str(RUN), json.dumps(numbers)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


@pytest.mark.wasm
@pytest.mark.parametrize("noise", NOISES)
@pytest.mark.parametrize("name", AGENTS.built_in)
def test_a_module_learns_the_same_to_the_bit(learner, name, noise):
    folder, memory = learner(name)
    found = run_in_node(folder, noise)
    agent, result = make_run(make_case(name, noise=noise, **SHORT), SEED, RUN)
    assert found["imported"] == ["memory"]
    content = base64.b64decode(found["bytes"])
    lengths = np.zeros(SHORT["trials"], np.int64)
    lengths[: result.trials] = result.lengths
    stage = SUCCEEDED if result.success else FAILED
    ended = [("lengths", lengths), ("progress.stage", np.array([stage]))]
    for array, value in [*arrays_of(agent, "agent."), *ended]:
        offset = memory.offset(array)
        assert content[offset : offset + value.nbytes] == value.tobytes(), array


@pytest.mark.wasm
@pytest.mark.parametrize("name", AGENTS.built_in)
def test_a_module_is_small(learner, name):
    assert (learner(name)[0] / "learner.wasm").stat().st_size < 40_000


@pytest.mark.wasm
def test_a_linker_that_fails_is_reported():
    with pytest.raises(UprightError, match=r"failed: .*learner\.o"):
        link(b"no object file", ())


def test_a_missing_linker_is_reported(monkeypatch):
    monkeypatch.setenv("PATH", "")
    with pytest.raises(UprightError, match="wasm-ld is missing: it is in the package lld"):
        link(b"", ())
