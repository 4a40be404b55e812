"""Notebooks, run by a real kernel."""

import re
from types import SimpleNamespace

import nbformat
import pytest
from helpers import ROOT
from nbclient import NotebookClient

pytestmark = [
    pytest.mark.slow,
    # what the libraries that run notebooks say about themselves
    pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::RuntimeWarning"),
]


def execute(cells, folder):
    """Run cells one after the other, and return what each shows."""
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(text) for text in cells])
    run(notebook, folder)
    return [shown(cell) for cell in notebook.cells]


def run(notebook, folder):
    path = {"metadata": {"path": str(folder)}}
    NotebookClient(notebook, timeout=300, kernel_name="python3", resources=path).execute()


def shown(cell):
    """Return what a cell shows, by the kind of it."""
    parts = SimpleNamespace(text="", html="", png=False)
    for output in cell.outputs:
        data = output.get("data", {})
        parts.text += output.get("text", "") + data.get("text/plain", "")
        parts.html += data.get("text/html", "")
        parts.png |= "image/png" in data
    return parts


AGENT = """
import os, signal, threading, time
import numpy as np
import upright
from typing import NamedTuple

GAIN = 10.0

class Mine:
    def __init__(self, rng):
        self.rng = rng
    def begin_trial(self, rng):
        self.weights = rng.uniform(-1, 1, 4) * [1, 1, GAIN, 2]
    def act(self, observation, rng):
        return self.weights @ observation > 0
    def learn(self, before, action, after, fallen): ...
    def end_trial(self, fallen): ...
"""
COMPILED = """
class Fast(NamedTuple):
    weights: np.ndarray

    @upright.compiled
    def begin_trial(self, rng):
        for i in range(4):
            self.weights[i] = 2.0 * rng.random() - 1.0

    @upright.compiled
    def act(self, observation, rng):
        x, x_dot, theta, theta_dot = observation
        w = self.weights
        return w[0] * x + w[1] * x_dot + GAIN * w[2] * theta + 2.0 * w[3] * theta_dot > 0.0

    @upright.compiled
    def learn(self, before, action, after, fallen): ...

    @upright.compiled
    def end_trial(self, fallen): ...

    @upright.compiled
    def push_probability(self, observation):
        return 0.5

def fast(rng):
    return Fast(np.zeros(4))
"""
RUNS = """
case = upright.make_case(fast, steps=100)
print([upright.make_run(case, 5, run)[1].lengths.tolist() for run in range(6)])
"""
WRONG = """
class Wrong(Mine):
    def act(self, observation, rng):
        return missing  # here

try:
    upright.compare(Wrong, runs=2, progress=False)
except upright.UprightError as error:
    print(error)
"""
ENDLESS = """
class Endless(Mine):
    def begin_trial(self, rng):
        time.sleep(1000)

def interrupt():
    while True:
        time.sleep(0.1)
        with upright.Store("kept.sqlite") as store:
            if "3 runs" in repr(store):
                return os.kill(os.getpid(), signal.SIGINT)

upright.compare([], runs=1, steps=9, store="kept.sqlite", progress=False)  # compiles
threading.Thread(target=interrupt).start()
try:
    upright.compare(["random-search", Endless], runs=2, steps=100, store="kept.sqlite")
except KeyboardInterrupt:
    print("interrupted")
import multiprocessing
until = time.monotonic() + 60
while multiprocessing.active_children() and time.monotonic() < until:
    time.sleep(0.1)
print(len(multiprocessing.active_children()), upright.Store("kept.sqlite"))
"""


@pytest.fixture(scope="module")
def cells(tmp_path_factory):
    """Return what each cell of a notebook shows, by its name."""
    texts = {
        "agent": AGENT,
        "learn": "learned = upright.learn(Mine, steps=200); learned",
        "plot": "learned.plot()",
        "compare": "compared = upright.compare(Mine, runs=4, steps=200, seed=1); compared",
        "silent": "upright.compare(Mine, runs=1, steps=50, progress=False).frame()",
        "key": "print(upright.make_case(Mine).key)",
        "trials": "print(compared.frame().trials.tolist())",
        "comment": AGENT.replace("class Mine:", "class Mine:  # mine"),
        "same": "print(upright.make_case(Mine).key)",
        "again": AGENT.replace("GAIN = 10.0", "GAIN = 0.0"),
        "other": "print(upright.make_case(Mine).key)",
        "redefined": "compared = upright.compare(Mine, runs=4, steps=200, seed=1)\n"
        "print(compared.frame().trials.tolist())",
        "back": AGENT + COMPILED,
        "compiled": "policy, result = upright.learn(fast, steps=200); print(repr(policy), result)",
        "memory": "policy.memory",
        "both": "print(upright.compare([fast, 'q-learning'], runs=2, steps=100, seed=5))",
        "runs": RUNS,
        "slower": COMPILED.replace("GAIN * w[2]", "0.0 * w[2]"),
        "other runs": RUNS,
        "wrong": WRONG,
        "interrupted": ENDLESS,
    }
    folder = tmp_path_factory.mktemp("notebook")
    return dict(zip(texts, execute(list(texts.values()), folder), strict=True))


def test_a_class_of_the_notebook_learns(cells):
    assert "<td" in cells["learn"].html
    assert ">Mine</td>" in cells["learn"].html
    assert "Policy('__main__:Mine', steps=200, seed=0, run=0)" in cells["learn"].text
    assert cells["plot"].png


def test_a_comparison_shows_its_progress_and_a_table(cells):
    html = cells["compare"].html
    assert re.search(r"<small>8 runs, [\d.]+ s</small>", html)
    assert ">Mine</td>" in html
    assert ">random-search</td>" in html
    assert cells["silent"].html.count("<small>") == 0
    assert cells["silent"].html.count("<tr") == 3


def test_a_class_that_is_defined_again_has_runs_of_its_own(cells):
    assert cells["same"].text == cells["key"].text
    assert cells["other"].text != cells["key"].text
    assert cells["redefined"].text != cells["trials"].text


def test_a_compiled_class_of_the_notebook_learns_and_is_measured(cells):
    assert cells["compiled"].text.startswith("Policy('__main__:fast', steps=200")
    assert "Fast(weights=array" in cells["memory"].text
    assert re.search(r"^fast +none +100 %", cells["both"].text, re.MULTILINE)
    assert cells["runs"].text != cells["other runs"].text


def test_an_error_in_a_class_of_the_notebook_is_shown_with_its_line(cells):
    assert "agent is '__main__:Wrong'; act failed in run" in cells["wrong"].text
    assert "return missing  # here" in cells["wrong"].text


def test_an_interrupt_stops_all_processes_and_keeps_finished_runs(cells):
    told = cells["interrupted"]
    assert "interrupted\n0 Store('kept.sqlite', " in told.text
    assert "3 runs)" in told.text
    assert "<small>stopped after 2 of 4 runs; they are kept in kept.sqlite, " in told.html


def test_the_tour_runs(tmp_path):
    notebook = nbformat.read(ROOT / "examples/notebook.ipynb", 4)
    run(notebook, tmp_path)
    codes = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert sum(shown(cell).png for cell in codes) == 3
    assert sum("<table" in shown(cell).html for cell in codes) == 4


def test_the_tour_is_stored_without_what_it_shows():
    notebook = nbformat.read(ROOT / "examples/notebook.ipynb", 4)
    nbformat.validate(notebook)
    for cell in notebook.cells:
        assert not cell.get("outputs")
        assert not cell.get("execution_count")
