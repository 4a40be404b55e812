"""The long run of tools/fuzz.py in short, and whether it notices what it looks for."""

import json
import subprocess
import sys
from textwrap import dedent

import pytest
from helpers import ROOT

pytestmark = pytest.mark.slow
FUZZ = ROOT / "tools/fuzz.py"
CONTROLS = """
    import json, os, sys, time
    from pathlib import Path

    sys.path.insert(0, {tools!r})
    import fuzz, fuzz_targets
    import numpy as np
    from upright.errors import UprightError

    def say_no(path):
        raise UprightError("no")

    def go_astray(path):
        Path("/tmp/upright-astray").write_text("x")

    kept = []
    READERS = {{
        "accepts": lambda path: path.read_bytes(),
        "refuses": say_no,
        "raises": lambda path: 1 / 0,
        "exits": lambda path: sys.exit(0),
        "aborts": lambda path: os.abort() if path.read_bytes()[:1] != b"a" else None,
        "hangs": lambda path: time.sleep(60) if path.read_bytes()[:1] != b"a" else None,
        "is slow": lambda path: time.sleep(2.1),
        "hoards": lambda path: kept.append(np.ones(10**7)),
        "leaves files": lambda path: Path("left").write_text("x"),
        "goes astray": go_astray,
        "starts programs": lambda path: os.system("true"),
    }}
    fuzz.SECONDS, fuzz.MEGABYTES = 2.0, 30.0
    seeds = lambda: [b"abc", b"bcd"]
    fuzz_targets.TARGETS |= {{
        name: fuzz_targets.Target(seeds, read, share=1) for name, read in READERS.items()
    }}
    if __name__ == "__main__":
        totals = fuzz.fuzz(list(READERS), 2 * len(READERS), 0, 1)
        print(json.dumps({{name: figures.failures for name, figures in totals.items()}}))
"""


def test_damaged_inputs_are_refused_or_accepted(tmp_path):
    command = [sys.executable, FUZZ, "--inputs", "3000", "--workers", "1", "--json", "figures.json"]
    ended = subprocess.run(
        command, cwd=tmp_path, capture_output=True, text=True, timeout=600, check=False
    )
    assert ended.returncode == 0, ended.stdout
    figures = json.loads((tmp_path / "figures.json").read_text())
    for name, each in figures.items():
        assert each["accepted"], name
        assert each["refused"] or name == "gazebo"  # whose answers have a length alone
    assert {path.name for path in tmp_path.iterdir()} == {"figures.json"}


def test_what_goes_wrong_is_noticed(tmp_path):
    script = tmp_path / "controls.py"
    script.write_text(dedent(CONTROLS).format(tools=str(ROOT / "tools")))
    ended = subprocess.run(
        [sys.executable, script], cwd=tmp_path, capture_output=True, text=True, timeout=300
    )
    found = json.loads(ended.stdout)
    said = {
        "raises": "ZeroDivisionError",
        "exits": "SystemExit",
        "aborts": "it ended the process with status -6",
        "hangs": "it had not ended after 4 s",
        "is slow": "it took 2.",
        "hoards": "it took 76 MB",
        "leaves files": "the job left left",
        "goes astray": "EscapedError: open of '/tmp/upright-astray'",
        "starts programs": "EscapedError: os.system",
    }
    for name, failures in found.items():
        assert bool(failures) is (name in said), (name, failures)
        assert said.get(name, "") in "".join(failures.values()), name


def test_inputs_follow_from_the_seed():
    code = f"""
        import sys
        sys.path.insert(0, {str(ROOT / "tools")!r})
        import hashlib, random
        from fuzz_inputs import damaged
        from fuzz_targets import TARGETS
        sha = hashlib.sha256()
        for name in ("policy-npz", "policy-json", "terms", "twin"):
            seeds = TARGETS[name].seeds()
            for number in range(100):
                sha.update(damaged(random.Random(f"{{number}}"), seeds, TARGETS[name].words()))
        print(sha.hexdigest())
    """
    runs = [
        subprocess.run([sys.executable, "-c", dedent(code)], capture_output=True, text=True)
        for _ in range(2)
    ]
    assert len(runs[0].stdout) == 65
    assert runs[0].stdout == runs[1].stdout
