import numpy as np
import pytest

from upright.agents import AGENTS
from upright.core.conditions import CONDITIONS, NOISES, PUBLISHED_NOISES, STARTS
from upright.core.task import TaskSpec
from upright.core.trials import Result
from upright.plants import PLANTS
from upright.plants.equations import EquationsSettings
from upright.reports.published import SOURCES, figures
from upright.reports.statistics import Row, summarise
from upright.studies.case import make_case

TABLES = {(source.name, source.agent): source for source in SOURCES}
REPORT_1, REPORT_2 = ("Report", "reinforce"), ("Report", "q-learning")
SI_WANG, HE, CARTPOLEMOD = (("Si & Wang 2001", None), ("He 2012", None), ("gym-cartpolemod", None))


def test_every_published_case_is_a_noise_case():
    assert set(PUBLISHED_NOISES) <= set(NOISES)
    assert len(PUBLISHED_NOISES) == 7


@pytest.mark.parametrize(
    ("table", "case", "mean_trials"),
    [
        (REPORT_1, "none", 35.65),
        (REPORT_1, "sensor-10", 44.1),
        (REPORT_1, "gaussian-0.2", 106.9),
        (REPORT_2, "none", 42),
        (SI_WANG, "none", 6),
        (SI_WANG, "sensor-5", 32),
        (SI_WANG, "gaussian-0.2", 193),
        (HE, "actuator-10", 20.6),
        (HE, "gaussian-0.1", 15.0),
        (CARTPOLEMOD, "actuator-5", 118.88),
        (CARTPOLEMOD, "gaussian-0.2", 209.59),
    ],
)
def test_figures_are_those_of_the_protocol(table, case, mean_trials):
    assert TABLES[table].mean_trials[case] == mean_trials


@pytest.mark.parametrize(
    ("table", "protocol"),
    [
        (REPORT_1, "20 runs, N = 60,000, start random"),
        (REPORT_2, "20 runs, N = 60,000, start random"),
        (SI_WANG, "100 runs, N = 600,000, start zero"),
        (HE, "100 runs, N = 600,000, start zero"),
        (CARTPOLEMOD, "100 runs, N = 60,000, start random"),
    ],
)
def test_runs_steps_and_starts_are_those_of_the_protocol(table, protocol):
    assert TABLES[table].protocol == protocol


@pytest.mark.parametrize("source", SOURCES, ids=lambda source: f"{source.name}-{source.agent}")
def test_sources_are_complete(source):
    expected = {"none"} if source is TABLES[REPORT_2] else set(PUBLISHED_NOISES)
    assert set(source.mean_trials) == expected
    assert source.agent is None or source.agent in AGENTS
    assert source.citation


def test_figures_appear_beside_the_agent_of_the_same_rule():
    usual, upright = TaskSpec(), TaskSpec(start="zero")
    assert figures("reinforce", usual) == {"Report": 35.65, "gym-cartpolemod": 119.68}
    assert figures("q-learning", usual) == {"Report": 42, "gym-cartpolemod": 119.68}
    assert figures("random-search", usual) == {"gym-cartpolemod": 119.68}
    assert figures("q-learning", TaskSpec("sensor-5")) == {}
    for agent in ("reinforce", "random-search", "module:Agent"):
        assert figures(agent, upright) == {"Si & Wang 2001": 6, "He 2012": 13.7}


@pytest.mark.parametrize("source", SOURCES, ids=lambda source: f"{source.name}-{source.agent}")
def test_a_figure_stands_beside_its_own_task_with_either_published_length(source):
    for noise in source.mean_trials:
        for steps in (60_000, 600_000):
            figure = source.figure(TaskSpec(noise, source.start, steps=steps))
            other = source.has_own_noise and noise != "none"
            assert figure == (None if other else source.mean_trials[noise])


OTHERS = [
    {"steps": 100},
    {"steps": 6_000_000},
    {"trials": 999},
    {"parameters": {"half_length": 1.0}},
    {"start": "wide"},
    {"noise": "all-5"},
    *({"condition": condition} for condition in CONDITIONS if condition != "nominal"),
]
"""How a task may differ from every published one."""


@pytest.mark.parametrize("change", OTHERS, ids=str)
@pytest.mark.parametrize("start", STARTS)
def test_no_figure_stands_beside_another_task(start, change):
    task = TaskSpec(**{"start": start} | change)
    assert not any(figures(agent, task) for agent in AGENTS)


@pytest.mark.parametrize("plant", [name for name in PLANTS if name != "equations"])
def test_no_figure_stands_beside_another_plant(plant):
    assert figures("reinforce", TaskSpec(), plant) == {}


RESULTS = [Result(0, True, np.array([60_000]), 0.1)]


def test_no_figure_stands_beside_another_integrator_or_environment():
    case = make_case("reinforce")
    other = make_case("reinforce", plant=EquationsSettings(integrator="rk4"))
    assert summarise(case, 0, RESULTS).published
    assert not summarise(other, 0, RESULTS).published
    row = summarise(case, 0, RESULTS, environment="CartPole-v1")
    assert (row.name, row.published) == ("reinforce (CartPole-v1)", {})


def test_a_row_of_an_earlier_version_gets_the_figures_of_its_task():
    row = summarise(make_case("reinforce", steps=100), 0, RESULTS)
    old = row.as_data() | {"published": {"Report": 35.65}}
    assert Row.from_data(old) == row
    row = summarise(make_case("reinforce"), 0, RESULTS)
    assert Row.from_data(row.as_data() | {"published": {}}) == row
