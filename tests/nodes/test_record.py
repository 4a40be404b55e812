"""Recordings of real nodes, read by other libraries."""

import csv
import io
import re
import signal
import time

import pytest
from ros2_helpers import NODE_MARKS, SETTLED, finish, has_begun, lengths

from upright.core.trials import Result
from upright.errors import UprightError
from upright.nodes.recordings import COLUMNS, CsvRecording, Message, Topic, open_recordings
from upright.studies.case import make_case
from upright.studies.run import make_run
from upright.support.exit_status import BAD_USE

pytestmark = [*NODE_MARKS, pytest.mark.usefixtures("domain")]
TOPICS = {"joint_states": Topic("/joint_states", "sensor_msgs/msg/JointState")}
JOINTS = ("slider", "hinge")


@pytest.fixture
def record(start):
    def record_to(*files, options=""):
        process = start(f"ros2 record {' '.join(map(str, files))} {options}")
        assert process.stdout.readline().startswith("recording /joint_states, /effort, /status")
        found = ""
        while not {"/joint_states", "/status"} <= set(re.findall(r"[\w/]+", found)):
            found += (line := process.stdout.readline())
            assert line.startswith("found "), line
        time.sleep(SETTLED)
        return process

    return record_to


@pytest.fixture
def recorded(record, simulate, start, tmp_path):
    """Return what the recorder printed, the trials of a learner, and both files."""
    simulate("--seed 3")
    files = tmp_path / "run.mcap", tmp_path / "run.csv"
    recorder = record(*files)
    status, out, told = finish(
        start("ros2 learn random-search --steps 3000 --trials 30 --watchdog 5")
    )
    assert status in (0, 1), told
    recorder.send_signal(signal.SIGINT)
    status, printed, told = finish(recorder)
    assert (status, told) == (0, "")
    return printed, lengths(out), *files


def rows(path):
    with path.open(newline="") as file:
        head, *found = csv.reader(file)
    assert tuple(head) == COLUMNS
    return [dict(zip(COLUMNS, row, strict=True)) for row in found]


def test_every_message_can_be_read_by_others(recorded):
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    printed, steps, mcap, table = recorded
    measured = rows(table)
    with mcap.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        assert reader.get_header().profile == "ros2"
        found = {}
        for _, channel, message, decoded in reader.iter_decoded_messages():
            assert channel.message_encoding == "cdr"
            assert "reliability: reliable\n" in channel.metadata["offered_qos_profiles"]
            found.setdefault(channel.topic, []).append((message.log_time, decoded))
    states = [decoded for _, decoded in found["/joint_states"]]
    assert [state.position[0] for state in states] == [float(row["x [m]"]) for row in measured]
    assert [state.velocity[1] for state in states] == [
        float(row["theta_dot [rad/s]"]) for row in measured
    ]
    assert {decoded.data for _, decoded in found["/status"]} >= {"Balancing", "Done"}
    assert f"{len(states):,} messages of /joint_states" in printed
    # A measurement for each start and each step, unless the recorder was too late for some.
    assert 0.9 * sum(steps) < len(states) <= sum(steps) + len(steps) + 2


def test_rosbags_reads_it(recorded):
    from rosbags.rosbag2.storage_mcap import McapReader
    from rosbags.typesys import Stores, get_typestore

    _, _, mcap, table = recorded
    reader, store = McapReader(mcap), get_typestore(Stores.LATEST)
    reader.open()
    assert reader.connections[0].ext.offered_qos_profiles
    kinds = {connection.topic: connection for connection in reader.connections}
    assert kinds["/effort"].msgtype == "std_msgs/msg/Float64MultiArray"
    states = [
        store.deserialize_cdr(data, connection.msgtype)
        for connection, _, data in reader.messages([kinds["/joint_states"]])
    ]
    reader.close()
    assert [state.position[1] for state in states] == [
        float(row["theta [rad]"]) for row in rows(table)
    ]


def test_a_row_has_the_command_and_the_status_before_it(recorded):
    *_, table = recorded
    found = rows(table)
    assert {row["status"] for row in found} >= {"Balancing", "Done"}
    assert {row["command"] for row in found if row["status"] == "Balancing"} <= {
        "10.0",
        "-10.0",
        "0.0",
        "",
    }
    trials = [int(row["trial"]) for row in found]
    assert trials == sorted(trials)
    stamps = [float(row["stamp [s]"]) for row in found]
    assert stamps == sorted(stamps)


def test_a_recorder_does_not_change_the_trials(record, simulate, start, tmp_path):
    simulate()
    record(tmp_path / "run.mcap")
    status, out, told = finish(start("learn reinforce --plant ros2 --steps 1000 --seed 3"))
    assert status == 0, told
    _, alone = make_run(make_case("reinforce", steps=1000), 3, 0)
    assert isinstance(alone, Result)
    assert lengths(out) == alone.lengths.tolist()


def test_what_it_misses_is_counted(record, simulate, start, tmp_path):
    simulate()
    recorder = record(tmp_path / "run.csv")
    learner = start("ros2 learn random-search --steps 100000000 --trials 100000")
    assert has_begun(learner)
    time.sleep(1)
    recorder.send_signal(signal.SIGSTOP)
    time.sleep(3)  # thousands of messages, of which a thousand wait
    recorder.send_signal(signal.SIGCONT)
    time.sleep(1)
    recorder.send_signal(signal.SIGINT)
    status, printed, told = finish(recorder)
    assert status == 0, told
    lost = re.search(r"messages of /joint_states \(([\d,]+) lost\)", printed)
    assert lost, printed
    assert int(lost[1].replace(",", "")) > 500


def test_the_clock_is_recorded_if_asked_for(record, simulate, start, tmp_path):
    simulate()
    recorder = record(tmp_path / "run.mcap", options="--clock")
    assert finish(start("ros2 learn random-search --steps 1000 --trials 3"))[0] in (0, 1)
    recorder.send_signal(signal.SIGTERM)
    assert re.search(r"\d+ messages of /clock", finish(recorder)[1])


def test_it_ends_after_a_number_of_trials_or_seconds(record, simulate, start, tmp_path):
    simulate()
    recorder = record(tmp_path / "run.csv", options="--trials 3")
    learner = start("ros2 learn random-search --steps 100000000 --trials 100000")
    assert has_begun(learner)
    status, out, told = finish(recorder)
    assert status == 0, told
    assert f"recording: {tmp_path / 'run.csv'}" in out
    status, out, _ = finish(start(f"ros2 record {tmp_path / 'more.csv'} --seconds 0.5"))
    assert status == 0


def test_a_killed_recording_can_be_read(record, simulate, start, tmp_path):
    from mcap.exceptions import EndOfFile, McapError
    from mcap.stream_reader import StreamReader

    simulate()
    files = tmp_path / "run.mcap", tmp_path / "run.csv"
    recorder = record(*files)
    learner = start("ros2 learn random-search --steps 100000000 --trials 100000")
    assert has_begun(learner)
    time.sleep(3)  # some parts are whole by then
    recorder.kill()
    finish(recorder)
    number = 0
    with files[0].open("rb") as file:
        try:
            for each in StreamReader(file).records:
                number += type(each).__name__ == "Message"
        except (EndOfFile, McapError):
            pass  # the last part is not whole
    assert number > 50
    text = files[1].read_text()
    whole = text[: text.rindex("\n") + 1]
    assert len(list(csv.reader(io.StringIO(whole)))) > 50


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("run.txt", "the ending of 'run.txt' is '.txt'; it must be one of .mcap, .csv"),
        ("there.csv", "'there.csv' exists; a recording replaces no file"),
        ("nowhere/run.csv", "nowhere"),
        ("run.csv --seconds 0", "seconds is 0"),
        ("run.csv --trials 0", "trials is 0"),
    ],
)
def test_what_is_not_possible_is_refused(line, message, start, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "there.csv").write_text("mine")
    status, _, told = finish(start(f"ros2 record {line}"))
    assert status == BAD_USE
    assert message in told
    assert len(told.splitlines()) == 1
    assert (tmp_path / "there.csv").read_text() == "mine"


def test_a_full_disk_ends_it_with_what_came_before():
    full = "/dev/full"
    with open(full, "w") as file, pytest.raises(UprightError, match="'/dev/full' cannot be writ"):
        CsvRecording(file, JOINTS).close()


def test_other_carts_are_recorded_too(tmp_path):
    from rclpy.serialization import serialize_message
    from sensor_msgs.msg import JointState

    path = tmp_path / "run.csv"
    with open_recordings([str(path)], TOPICS, ("rail", "pivot"), str) as [recording]:
        for message in (
            JointState(name=["rail", "pivot"], position=[0.1, 0.2], velocity=[0.3, 0.4]),
            JointState(name=["pivot", "rail"], position=[0.5, 0.6]),
            JointState(name=["wheel"], position=[0.7]),
        ):
            recording.write(Message("joint_states", serialize_message(message), 0, 0, 0))
        recording.write(Message("joint_states", b"garbage", 0, 0, 0))
    found = [[row[name] for name in COLUMNS[1:5]] for row in rows(path)]
    assert found == [["0.1", "0.3", "0.2", "0.4"], ["0.6", "", "0.5", ""]]


def test_if_one_file_cannot_be_made_none_is(tmp_path):
    paths = [str(tmp_path / "run.mcap"), str(tmp_path / "missing" / "run.csv")]
    with pytest.raises(UprightError, match="missing"), open_recordings(paths, TOPICS, JOINTS, str):
        pass
    assert not list(tmp_path.iterdir())
