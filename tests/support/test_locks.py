import signal
import threading

import pytest

from upright.errors import UprightError
from upright.support.interrupts import hold_interrupts
from upright.support.locks import locked


def test_one_at_a_time_holds_a_lock(tmp_path):
    path = tmp_path / "file"
    path.write_text("kept")
    inside, most = 0, 0

    def work():
        nonlocal inside, most
        for _ in range(200):
            with locked(path):
                inside += 1
                most = max(most, inside)
                inside -= 1

    threads = [threading.Thread(target=work) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert most == 1
    assert [file.name for file in tmp_path.iterdir()] == ["file"]
    assert path.read_text() == "kept"


def test_who_waits_can_be_interrupted(tmp_path):
    (tmp_path / "file").touch()
    interrupt = signal.pthread_kill, (threading.main_thread().ident, signal.SIGINT)

    def wait():
        with hold_interrupts(), locked(tmp_path / "file"):
            pass

    with locked(tmp_path / "file"):
        threading.Timer(0.1, *interrupt).start()
        with pytest.raises(KeyboardInterrupt):
            wait()
    with locked(tmp_path / "file"):
        pass


def test_a_file_that_is_missing_cannot_be_locked(tmp_path):
    with pytest.raises(UprightError, match=r"^file is '.*missing'; it cannot be opened: No such"):
        locked(tmp_path / "missing").__enter__()
