from upright.reports.standing import plan_text, status_text
from upright.studies.case import make_case
from upright.studies.estimate import Measure, Probe, Standing

CASE = make_case("random-search", steps=300)
OTHER = make_case("q-learning", steps=300, noise="sensor-5", parameters={"half_length": 0.25})


def standing(case, wanted, finished, seconds=None):
    known = seconds.runs if seconds else 0
    size = seconds and seconds._replace(mean=1000.0)
    return Standing(case, range(wanted), finished, known, known, 5.25, seconds, size)


def words(line):
    """Return the words of a line with a space between."""
    return " ".join(line.split())


DONE = standing(CASE, 4, 4, Measure(2.0, 1.0, 4))
SLOW = Measure(7200.0, 3600.0, 2)


def plan(*several, tried=None, is_least=False):
    return plan_text(Probe(list(several), tried or {}, is_least), 4, "a.sqlite").splitlines()


def test_a_plan_tells_what_there_is_to_do_and_where_that_is_from(monkeypatch):
    monkeypatch.setattr("upright.studies.estimate.cpu_count", lambda: 2)
    lines = plan(DONE, standing(OTHER, 4, 2, SLOW), tried={OTHER: 2})
    assert lines == [
        "study: 2 cases of 4 runs each: 8",
        "store: a.sqlite, which has 6 of them",
        "to do: 2 runs",
        "time: about 2 h (0 s to 4 h), 2 runs at once",
        "disk: about 2 kB",
        "from: 6 runs of 2 cases in the store; 2 runs of 1 case, made now and not kept",
    ]


def test_a_plan_with_nothing_to_do_is_short():
    assert plan(DONE)[-1] == "to do: 0 runs"


def test_a_plan_of_a_part_says_so():
    assert plan(standing(CASE, 2, 1, Measure(2.0, 1.0, 1)))[0].endswith("each: 4; this part: 2")


def test_what_is_not_known_is_said_to_be_unknown():
    lines = plan(standing(CASE, 4, 0))
    assert lines[-3:] == [
        "time: unknown, until a run on equations is finished",
        "disk: unknown",
        "from: nothing",
    ]
    lines = plan(DONE, standing(OTHER, 4, 0))
    assert lines[-1].endswith("of 1 case in the store; the mean of these for 1 other case")


def test_a_run_that_was_stopped_makes_a_bound():
    (line,) = plan(standing(OTHER, 4, 0, SLOW), is_least=True)[3:4]
    assert line.startswith("time: more than ")


def test_the_status_has_a_line_for_each_case_and_columns_where_they_differ():
    lines = status_text([DONE, standing(OTHER, 4, 0)], "a.sqlite").splitlines()
    assert words(lines[0]) == "Agent Noise half_length [m] Runs Success Mean trials Time left"
    assert words(lines[2]) == "random-search none 0.5 4/4 100 % 5.2 –"
    assert words(lines[3]) == "q-learning sensor-5 0.25 0/4 – 5.2 unknown"
    assert lines[-1].startswith("4 of 8 runs are finished in a.sqlite; time left: ")


def test_the_status_of_one_case_names_its_agent():
    lines = status_text([DONE], "a.sqlite").splitlines()
    assert words(lines[0]) == "Agent Runs Success Mean trials Time left"
    assert lines[-1] == "4 of 4 runs are finished in a.sqlite; nothing is left to do."


def test_the_status_of_one_run_is_in_the_singular():
    text = status_text([standing(CASE, 1, 1, Measure(2.0, 1.0, 1))], "a.sqlite")
    assert text.endswith("1 of 1 run is finished in a.sqlite; nothing is left to do.\n")
