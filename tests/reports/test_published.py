import pytest

from upright.agents import AGENTS
from upright.core.conditions import NOISES, PUBLISHED_NOISES
from upright.reports.published import SOURCES, figures

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
    ("table", "runs", "steps"),
    [
        (REPORT_1, 20, 60_000),
        (REPORT_2, 20, 60_000),
        (SI_WANG, 100, 600_000),
        (CARTPOLEMOD, 100, 60_000),
    ],
)
def test_runs_and_steps_are_those_of_the_protocol(table, runs, steps):
    assert (TABLES[table].runs, TABLES[table].steps) == (runs, steps)


@pytest.mark.parametrize("source", SOURCES, ids=lambda source: f"{source.name}-{source.agent}")
def test_sources_are_complete(source):
    expected = {"none"} if source is TABLES[REPORT_2] else set(PUBLISHED_NOISES)
    assert set(source.mean_trials) == expected
    assert source.agent is None or source.agent in AGENTS
    assert source.citation


def test_figures_appear_beside_the_agent_of_the_same_rule():
    everywhere = {"Si & Wang 2001": 6, "He 2012": 13.7, "gym-cartpolemod": 119.68}
    assert figures("reinforce", "none") == {"Report": 35.65} | everywhere
    assert figures("q-learning", "none") == {"Report": 42} | everywhere
    assert figures("random-search", "none") == everywhere
    assert "Report" not in figures("q-learning", "sensor-5")
    assert figures("reinforce", "all-5") == {}
