"""Studies on a real dask cluster: a scheduler and workers, processes of this machine."""

import json
import os
import pickle
import signal
import socket
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from types import SimpleNamespace

import cloudpickle
import pytest
from helpers import COMMAND, python

from upright.commands import run
from upright.errors import UprightError
from upright.plants.mujoco import Mujoco
from upright.studies import cluster
from upright.studies.case import make_case
from upright.studies.executors import ADDRESS, Local
from upright.studies.recorded_environment import present_environment
from upright.studies.run import make_run
from upright.studies.store import Store
from upright.studies.study import make_missing_runs, stored, study
from upright.support.exit_status import BAD_USE, INTERRUPTED

distributed = pytest.importorskip("distributed")

MODEL = Path(__file__).parents[1] / "data" / "models" / "slider.urdf"
LIMIT = 240
"""What is waited for must come within this time [s]."""
CASE = make_case("random-search", steps=300)
TABLE = "table --agents random-search --noises none --steps 600000"


def wait_for(is_so, process=None):
    until = time.monotonic() + LIMIT
    while not is_so():
        assert process is None or process.poll() is None, process.communicate()
        assert time.monotonic() < until
        time.sleep(0.02)


@contextmanager
def started(*words, **environment):
    """Run a program of dask's within the block, and kill it."""
    process = subprocess.Popen(
        [sys.executable, "-m", *words],
        env=os.environ | environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        yield process
    finally:
        process.kill()
        process.wait()


class Machines:
    """A scheduler and two workers with a thread each."""

    def __init__(self, folder):
        self.folder = folder
        self.opened = ExitStack()
        place = folder / "scheduler.json"
        quiet = ("--host", "127.0.0.1", "--no-dashboard")
        where = ("--port", "0", "--dashboard-address", "127.0.0.1:0", "--scheduler-file", place)
        self.scheduler = self.start("distributed.cli.dask_scheduler", *quiet, *where)
        wait_for(lambda: place.exists() and place.read_text(), self.scheduler)
        self.address = json.loads(place.read_text())["address"]
        one = ("--nthreads", "1", "--memory-limit", "0", "--local-directory", folder)
        for _ in range(2):
            self.start("distributed.cli.dask_worker", self.address, *quiet, *one)
        with self.client() as client:
            client.wait_for_workers(2, timeout=LIMIT)

    def start(self, *words):
        return self.opened.enter_context(started(*map(str, words)))

    def client(self):
        return distributed.Client(self.address, set_as_default=False)


@pytest.fixture(scope="module")
def machines(tmp_path_factory):
    made = Machines(tmp_path_factory.mktemp("machines"))
    with made.opened:
        yield made


def contents(found):
    """Return all that results say but the time they took."""
    return {
        (case.key, result.run): (result.success, result.lengths.tolist())
        for case, results in found.items()
        for result in results
    }


@contextmanager
def command(folder, line):
    process = subprocess.Popen(
        [*COMMAND, *line.split()],
        cwd=folder,
        stderr=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def kept(path):
    return sum(len(results) for _, _, results in stored(path)) if path.exists() else 0


@pytest.mark.slow
def test_results_are_those_of_threads(machines):
    cases = [CASE, make_case("random-search", noise="gaussian-0.2", steps=300)]
    there, here = (study(cases, 30, executor=each) for each in (machines.address, "threads"))
    assert contents(there) == contents(here)


@pytest.mark.slow
def test_runs_are_recorded_with_the_environment_of_their_worker(machines, monkeypatch):
    monkeypatch.setattr("upright.studies.store.present_environment", lambda: "that of the store")
    with Store() as store:
        make_missing_runs([CASE], 2, 0, store, executor=machines.address)
        assert [*store.environments().values()] == [(present_environment(), 2)]


AGENT = """
    from {other} import SCALE
    class Guess:
        def __init__(self, rng): self.w = rng.normal(size=4)
        def begin_trial(self, rng): self.w = rng.normal(size=4) * SCALE
        def act(self, observation, rng): return bool(self.w @ observation > 0)
        def learn(self, before, action, after, fallen): ...
        def end_trial(self, fallen): ...
"""


@pytest.mark.slow
def test_the_files_of_a_custom_agent_travel_in_each_version(machines, write):
    other = write("SCALE = (1.0, 1.0, 10.0, 1.0)")
    name = write(AGENT.format(other=other))
    found = []
    for scale in (10.0, 30.0):
        write(f"SCALE = (1.0, 1.0, {scale}, 1.0)", other)
        for module in (other, name):
            sys.modules.pop(module, None)
        case = make_case(f"{name}:Guess", steps=100)
        there, here = (study([case], 6, executor=each) for each in (machines.address, "threads"))
        assert contents(there) == contents(here)
        found.append([lengths for _, lengths in contents(here).values()])
    assert found[0] != found[1]


@pytest.mark.slow
def test_what_a_script_defines_travels(machines, write, tmp_path):
    base = write(AGENT.format(other="math").replace("SCALE", "pi"))
    script = f"""\
import upright
from {base} import Guess
class Mine(Guess):
    def act(self, observation, rng): return not super().act(observation, rng)
class Broken(Guess):
    def act(self, observation, rng): raise KeyError("nothing")
case = upright.make_case(Mine, steps=100)
there, here = (upright.study([case], 4, executor=e) for e in ({machines.address!r}, "threads"))
print([r.lengths.tolist() for r in there[case]] == [r.lengths.tolist() for r in here[case]])
upright.study([upright.make_case(Broken, steps=100)], 1, executor={machines.address!r})
"""
    (tmp_path / "script.py").write_text(script)
    done = subprocess.run(
        [sys.executable, "script.py"], capture_output=True, text=True, timeout=LIMIT, check=False
    )
    assert done.stdout == "True\n", done.stderr
    assert "AgentError: agent is '__main__:Broken'; act failed in run 0" in done.stderr


@pytest.mark.slow
def test_a_worker_of_another_version_is_refused(machines, monkeypatch):
    ours = cluster.environment()
    monkeypatch.setattr(cluster, "environment", lambda: ours | {"upright": "0.0 (other)"})
    with pytest.raises(UprightError) as error:
        study([CASE], 1, executor=machines.address)
    said = f"it has upright {ours['upright']}; it must be 0.0 (other), as here"
    assert str(error.value).startswith("worker is 'tcp://127.0.0.1:")
    assert str(error.value).endswith(said)


@pytest.mark.slow
def test_an_interrupt_cancels_what_the_workers_do(machines, tmp_path):
    line = (
        "table --agents random-search --noises none --runs 100000 --steps 600000 --store a.sqlite"
    )
    with command(tmp_path, f"{line} --executor dask --address {machines.address}") as process:
        wait_for(lambda: kept(tmp_path / "a.sqlite") > 5, process)
        process.send_signal(signal.SIGINT)
        _, told = process.communicate(timeout=LIMIT)
    assert process.returncode == INTERRUPTED
    assert "finished runs are kept in a.sqlite; the same command goes on" in told
    assert "Traceback" not in told
    with machines.client() as client:
        wait_for(lambda: not any(client.processing().values()))


@pytest.mark.slow
def test_killed_workers_change_nothing_and_after_a_killed_scheduler_the_command_goes_on(tmp_path):
    case, runs, store = make_case("random-search", steps=600_000), 300, tmp_path / "runs.sqlite"
    line = (
        "table --agents random-search --noises none --steps 600000 --runs 300 --store runs.sqlite"
    )
    line += " --executor dask --address "
    first = Machines(tmp_path)
    with first.opened, command(tmp_path, line + first.address) as process:
        wait_for(lambda: kept(store) > 5, process)
        with first.client() as client:
            workers = list(client.run(os.getpid).values())
            nannies = list(client.run(os.getppid).values())
        for killed in (workers[0], nannies[1]):
            before = kept(store)
            os.kill(killed, signal.SIGKILL)
            wait_for(lambda least=before: kept(store) > least, process)
        first.scheduler.kill()
        _, told = process.communicate(timeout=LIMIT)
    assert process.returncode == BAD_USE
    *waited, told = told.splitlines()  # after a killed worker there may be none for a while
    assert set(waited) <= {f"upright: waiting for workers at {first.address}"}
    assert told.startswith(f"upright: error: address is '{first.address}'; the scheduler is gone;")
    assert 5 < kept(store) < runs
    (tmp_path / "again").mkdir()
    again = Machines(tmp_path / "again")
    with again.opened, command(tmp_path, line + again.address) as process:
        _, told = process.communicate(timeout=LIMIT)
    assert process.returncode == 0, told
    with Store(store) as there:
        found = {case: there.results(case.key, 0)}
    assert contents(found) == contents(study([case], runs))


# ------------------------------------------------------------------------------ without workers


@pytest.fixture
def scheduler():
    """The address of a scheduler in this process, which has no worker."""
    with distributed.LocalCluster(
        n_workers=0,
        processes=False,
        host="127.0.0.1",
        protocol="tcp",
        dashboard_address="127.0.0.1:0",  # None would be port 8787 of every address
    ) as made:
        yield made.scheduler_address


def test_a_worker_without_the_package_is_refused():
    sent = pickle.dumps(cloudpickle.dumps(cluster._on_worker))
    done = python(
        "import pickle, sys, types\n"
        "sys.modules['upright'] = None\n"
        "worker = types.SimpleNamespace(address='tcp://far:1')\n"
        "sys.modules['distributed'] = types.SimpleNamespace(get_worker=lambda: worker)\n"
        f"work = pickle.loads(pickle.loads({sent!r}))\n"
        "print(work({}, None, b'')[:2])"
    )
    assert done.stdout == "('refused', 'tcp://far:1')\n", done.stderr


def test_no_worker_comes(scheduler, monkeypatch, capsys):
    monkeypatch.setattr(cluster, "ARRIVING", 0.1)
    with pytest.raises(UprightError, match=r"address is '.*'; no worker has come for 0\.1 s"):
        study([CASE], 1, executor=scheduler)
    assert capsys.readouterr().err == f"upright: waiting for workers at {scheduler}\n"


def test_no_scheduler_is_there(monkeypatch, capsys):
    monkeypatch.setattr(cluster, "ANSWERING", 0.1)
    line = "table --agents random-search --noises none --runs 1 --executor dask --address"
    assert run([*line.split(), "tcp://127.0.0.1:9"]) == BAD_USE
    told = capsys.readouterr().err
    assert told.startswith("upright: error: address is 'tcp://127.0.0.1:9'; no dask scheduler")
    assert len(told.splitlines()) == 1


def test_a_socket_that_says_nothing_is_no_scheduler(monkeypatch):
    monkeypatch.setattr(cluster, "ANSWERING", 0.2)
    with socket.create_server(("127.0.0.1", 0)) as silent:
        address = f"tcp://127.0.0.1:{silent.getsockname()[1]}"
        with pytest.raises(
            UprightError, match=r"no dask scheduler answers there: nothing was said for 0\.2 s"
        ):
            study([CASE], 1, executor=address)


@pytest.mark.slow
@pytest.mark.parametrize("address", ["tcp://127.0.0.1", "a://127.0.0.1:1", "tls://127.0.0.1:1"])
def test_what_is_no_address_is_refused_in_one_line(address):
    """In a process of its own, since a client that failed complained when it was freed."""
    line = "table --agents random-search --noises none --runs 1 --executor dask --address"
    words = [sys.executable, "-m", "upright", *line.split(), address]
    ended = subprocess.run(words, capture_output=True, text=True, timeout=120)
    assert ended.returncode == BAD_USE
    why = f"upright: error: address is '{address}'; no dask scheduler answers"
    assert ended.stderr.startswith(why)
    assert len(ended.stderr.splitlines()) == 1


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--address", "tcp://a:1"], "address is 'tcp://a:1'; it needs --executor dask"),
        (["--executor", "dask"], "executor is 'dask'; it needs --address tcp://HOST:PORT"),
        (["--executor", "dask", "--address", "a:1"], "address is 'a:1'; it must be like tcp://"),
    ],
    ids=["no cluster", "no address", "no URL"],
)
@pytest.mark.parametrize("name", ["table", "leaderboard", "robust", "tune random-search"])
def test_options_that_do_not_fit_are_refused(name, words, message, monkeypatch, capsys, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv(ADDRESS, raising=False)
    agents = [] if name.startswith("tune") else ["--agents", "random-search"]
    assert run([*name.split(), *agents, "--runs", "1", "--steps", "100", *words]) == BAD_USE
    assert f"error: {message}" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("case", "message"),
    [
        ({"plant": "ros2"}, "plant is 'ros2'; its runs are made on this machine alone"),
        ({"language": "MATLAB"}, "language is 'MATLAB'; a cluster has only runs of Python"),
    ],
    ids=["ros2", "MATLAB"],
)
def test_what_one_machine_alone_has_is_refused(case, message, scheduler):
    case = make_case("random-search", steps=300, **case)
    with pytest.raises(UprightError, match=message):
        study([case], 1, executor=scheduler)


@pytest.mark.parametrize("executor", [3, "ray", "localhost:8786"])
def test_what_is_no_executor_is_refused(executor):
    with pytest.raises(UprightError, match=f"executor is {executor!r}; it must be threads, proc"):
        study([CASE], 1, executor=executor)


# ------------------------------------------------------------------------------ custom code


@pytest.fixture
def worker(tmp_path, monkeypatch):
    """Let this process do the work of a worker."""
    here = SimpleNamespace(local_directory=tmp_path)
    monkeypatch.setattr(distributed, "get_worker", lambda: here)
    monkeypatch.setattr(sys, "path", [*sys.path])
    for name in ("_present", "_folders", "_owners", "_definitions"):
        monkeypatch.setattr(cluster, name, type(getattr(cluster, name))())


def sent(case, work, *arguments):
    """Return what a worker is sent."""
    sender = cluster.Cluster.__new__(cluster.Cluster)
    sender._codes = {}
    assert case.key  # as it is here
    return sender._code_of([case]), pickle.dumps((work, [case], arguments))


def test_studies_whose_modules_have_the_same_names_take_turns(worker, write):
    helper = write("SCALE = 1.0")
    name = write(AGENT.format(other=helper))
    packed, expected = [], []
    for scale in ("[1.0, 1.0, 10.0, 1.0]", "[1.0, 1.0, 30.0, 1.0]"):
        write(f"SCALE = {scale}", helper)
        for module in (helper, name):
            sys.modules.pop(module, None)
        case = make_case(f"{name}:Guess", steps=100)
        packed.append(sent(case, make_run, case, 0, 0))
        expected.append(make_run(case, 0, 0)[1].lengths.tolist())
    assert expected[0] != expected[1]
    Path(sys.modules[helper].__file__).unlink()
    modules = []
    for turn in range(4):
        _, result, *_ = cluster.perform(cluster.environment(), *packed[turn % 2])
        assert result.lengths.tolist() == expected[turn % 2]
        modules.append(sys.modules[name])
    assert modules[:2] == modules[2:]  # not compiled anew
    assert modules[0] is not modules[1]


@pytest.mark.parametrize("change", ["missing", "other"])
def test_a_worker_without_the_model_of_a_plant_is_refused(change, worker, tmp_path):
    pytest.importorskip("mujoco")
    path = tmp_path / "cart.urdf"
    path.write_text(MODEL.read_text())
    case = make_case("random-search", plant=Mujoco(model=str(path)), steps=100)
    code, packed = sent(case, make_run, case, 0, 0)
    if change == "missing":
        path.unlink()
        why = "model is '.*cart.urdf'; it cannot be read: No such file or directory"
    else:
        path.write_text(path.read_text().replace('mass value="0.2"', 'mass value="0.3"'))
        why = "plant is 'mujoco', of which it has another version"
    with pytest.raises(cluster.Refused, match=f"{why}; workers need the same file"):
        cluster.perform(cluster.environment(), code, packed)


def test_a_custom_agent_that_fails_on_a_worker_is_refused_in_one_line(worker, write, tmp_path):
    (tmp_path / "data.txt").touch()
    text = "open('data.txt').close()" + AGENT.format(other="math").replace("SCALE", "pi")
    name = write(text.replace("\n    ", "\n"))
    case = make_case(f"{name}:Guess", steps=100)
    code, packed = sent(case, make_run, case, 0, 0)
    sys.modules.pop(name)
    Path(f"{name}.py").unlink()
    (tmp_path / "data.txt").unlink()
    with pytest.raises(cluster.Refused, match=r"FileNotFoundError: .* 'data\.txt'") as error:
        cluster.perform(cluster.environment(), code, packed)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("second", "is_plain", "together"),
    [(b"1", False, True), (b"2", False, False), (b"1", True, False)],
    ids=["same code", "other code", "plain Python"],
)
def test_only_pieces_of_one_compiled_code_are_at_work_together(second, is_plain, together):
    begun = threading.Event()

    def begin():
        with cluster._turn(cluster.Code(second, (), is_plain)):
            begun.set()

    with ThreadPoolExecutor(1) as pool:
        with cluster._turn(cluster.Code(b"1", (), is_plain)):
            waiting = pool.submit(begin)
            wait_for(lambda: begun.is_set() or cluster._door.locked())
            assert begun.wait(LIMIT if together else 0.05) == together
        waiting.result(LIMIT)
    assert begun.is_set()


# ------------------------------------------------------------------------------ pieces of work


class Pieces(Local):
    """One thread that takes pieces of many runs, and notes the size of each."""

    most = 1000

    def __init__(self, budget):
        super().__init__(ThreadPoolExecutor(1), own=True)
        self.budget = budget
        self.sizes, self.outstanding, self.largest = [], 0, 0

    def window(self):
        return 4

    def submit(self, work, cases, *arguments):
        self.sizes.append(len(arguments[0]))
        self.outstanding += 1
        self.largest = max(self.largest, self.outstanding)
        return super().submit(work, cases, *arguments)

    def result(self, future):
        self.outstanding -= 1
        return super().result(future)


@pytest.mark.parametrize(("budget", "expected"), [(1e9, {1, 2, 4, 8}), (-1.0, {1, 2})])
def test_pieces_grow_while_they_are_finished_in_time(budget, expected):
    cases = [CASE, make_case("random-search", steps=200)]
    with Store() as store, closing(Pieces(budget)) as workers:
        store.add(CASE.key, 0, make_run(CASE, 0, 3)[1])
        make_missing_runs(cases, 40, 0, store, executor=workers)
        found = {case: store.results(case.key, 0) for case in cases}
    assert workers.sizes[0] == workers.sizes[-1] == 1  # the last ones keep all workers busy
    assert expected <= {*workers.sizes}
    assert max(workers.sizes) <= 20
    assert workers.largest == 4
    assert contents(found) == contents(study(cases, 40))
