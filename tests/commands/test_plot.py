import pytest

from upright.commands import run
from upright.commands.plot import runs_to_draw
from upright.support.exit_status import BAD_USE


@pytest.fixture
def make_runs(tmp_path, monkeypatch, capsys):
    """Return a function that adds two runs of each noise case to a store, in an empty folder."""
    monkeypatch.chdir(tmp_path)

    def make(noises, seed):
        study = f"table --agents random-search --noises {noises} --runs 2 --steps 300"
        assert run([*study.split(), "--seed", str(seed), "--store", "runs.sqlite"]) == 0
        capsys.readouterr()

    return make


def test_a_store_without_noise_free_runs_is_drawn_too(make_runs, tmp_path, capsys):
    make_runs("sensor-5", 0)
    for what in ("curves", "trials"):
        assert run(["plot", what, "runs.sqlite", "--output", f"{what}.svg"]) == 0
        assert (tmp_path / f"{what}.svg").read_text().startswith("<?xml")
    assert capsys.readouterr().out == "picture: curves.svg\npicture: trials.svg\n"


def test_two_seeds_of_a_case_are_told_apart(make_runs):
    make_runs("none,sensor-5", 0)
    make_runs("none", 1)
    labels = [(case.spec.noise, case.label) for case, _ in runs_to_draw("runs.sqlite")]
    assert sorted(labels) == [
        ("none", "default, seed 0"),
        ("none", "default, seed 1"),
        ("sensor-5", "default"),
    ]


def test_the_curve_of_a_run_is_titled_in_words(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    titles = []
    monkeypatch.setattr(
        "upright.reports.plots.plot_curve",
        lambda lengths, steps, *texts: titles.append(texts),
    )
    monkeypatch.setattr("upright.reports.plots.save", lambda figure, path: None)
    line = "learn random-search --noise sensor-5 --steps 300 --seed 3 --quiet --plot curve.png"
    assert run(line.split()) == 0
    assert titles == [
        (
            "Random search, 5 % sensor noise",
            "success after 300 steps; seed 3, run 0",
            "random-search",
        )
    ]
    capsys.readouterr()


def test_a_sweep_of_a_store_is_drawn(make_runs, tmp_path, capsys):
    make_runs("none --parameter half_length=0.5:1:2 --parameter force=5,10", 0)
    line = "plot sweep runs.sqlite --output sweep.svg --parameter half_length"
    assert run(line.split()) == 0
    assert (tmp_path / "sweep.svg").read_text().startswith("<?xml")
    assert capsys.readouterr().out == "picture: sweep.svg\n"


@pytest.mark.parametrize(
    ("noises", "line", "said"),
    [
        ("none", "plot sweep runs.sqlite", "there is no sweep: all runs have the same parameters"),
        ("none", "plot sweep missing.sqlite", "store is 'missing.sqlite'"),
        ("none", "plot sweep runs.sqlite --parameter force", "there is no sweep"),
        ("none", "plot trials runs.sqlite --parameter force", "it is for upright plot sweep"),
        (
            "none --parameter force=5,10 --parameter gravity=9,10",
            "plot sweep runs.sqlite",
            "runs differ in gravity and force; choose one: --parameter gravity",
        ),
    ],
)
def test_a_sweep_that_is_not_there_is_refused_in_one_line(make_runs, noises, line, said, capsys):
    make_runs(noises, 0)
    assert run(line.split()) == BAD_USE
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
