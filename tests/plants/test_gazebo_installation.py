"""Bringing Gazebo, finding it, and telling what is missing: mostly without a Gazebo."""

import fcntl
import hashlib
import os
import shutil
import subprocess
from pathlib import Path

import pytest

from upright.commands import run
from upright.errors import UprightError
from upright.plants.gazebo import installation, installer
from upright.plants.gazebo.installation import LIBRARY, environment, find_gazebo
from upright.plants.gazebo.installer import (
    Apt,
    Package,
    install_packages,
    machine_mirror,
    mirrors_in_list,
    mirrors_in_sources,
    parse_names,
    parse_packages,
    reason,
    remove,
)

needs_debian = pytest.mark.skipif(
    not (shutil.which("dpkg-deb") and shutil.which("apt-get")), reason="needs Debian's tools"
)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Provide a private folder and plugin sources, on a machine with too old a Gazebo."""
    program(tmp_path / "old/gzserver", "echo Gazebo multi-robot simulator, version 9.0.0")
    monkeypatch.setenv("PATH", f"{tmp_path}/old:{os.environ['PATH']}")
    plugin = tmp_path / "sources"
    plugin.mkdir()
    (plugin / "CMakeLists.txt").write_text("project(x)\n")
    (plugin / "stepper.cc").write_text("int one;\n")
    monkeypatch.setattr(installation, "sources", lambda: plugin)
    monkeypatch.setattr(installer, "sources", lambda: plugin)
    monkeypatch.setenv("UPRIGHT_GAZEBO", str(tmp_path / "gazebo"))
    find_gazebo.cache_clear()
    yield tmp_path / "gazebo"
    find_gazebo.cache_clear()


def program(path, text):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(0o755)


def unpacked_gazebo(folder):
    """Pretend that all packages were unpacked."""
    server = folder / "prefix/usr/bin/gzserver"
    # As the real one: its exit status is not 0.
    program(server, 'echo "Gazebo multi-robot simulator, version 11.1.0"; exit 255')
    (folder / "prefix/usr/include/gazebo-11").mkdir(parents=True)
    (folder / "complete").touch()
    return server


# Finding it


def test_a_missing_gazebo_is_reported_with_the_remedy(folder):
    with pytest.raises(UprightError, match="missing; `upright gazebo install` installs it"):
        find_gazebo()


def test_an_incomplete_gazebo_counts_as_missing(folder):
    unpacked_gazebo(folder)
    (folder / "complete").unlink()
    with pytest.raises(UprightError, match="Gazebo 11 is missing"):
        find_gazebo()


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give files to others")
def test_a_gazebo_that_another_user_could_change_is_not_run(folder):
    program(unpacked_gazebo(folder), f"touch {folder}/has-run")
    os.chown(folder / "prefix", 65534, 65534)
    with pytest.raises(UprightError, match=r"others may change '.*prefix', so Gazebo is not run"):
        find_gazebo()
    assert not (folder / "has-run").exists()


def test_a_gazebo_that_does_not_run_is_reported(folder):
    program(unpacked_gazebo(folder), "exit 127")
    with pytest.raises(UprightError, match=r"does not run; .* --remove"):
        find_gazebo()


def test_the_plugin_must_be_built_from_the_present_sources(folder):
    server = unpacked_gazebo(folder)
    with pytest.raises(UprightError, match="plugin is not built; `upright gazebo install` builds"):
        find_gazebo()
    plugin = installation.find_program().plugin
    plugin.parent.mkdir(parents=True)
    plugin.touch()
    found = find_gazebo()
    assert (found.server, found.plugin, found.version) == (server, plugin, "11.1.0")
    assert found.environment["GAZEBO_PLUGIN_PATH"].startswith(f"{plugin.parent}:")
    find_gazebo.cache_clear()
    (installation.sources() / "stepper.cc").write_text("int two;\n")
    with pytest.raises(UprightError, match="was built from other sources"):
        find_gazebo()


def test_a_gazebo_on_the_path_comes_first_if_it_is_eleven(folder, monkeypatch):
    unpacked_gazebo(folder)
    own = folder.parent / "own/bin/gzserver"
    program(own, "echo Gazebo multi-robot simulator, version 11.14.0")
    monkeypatch.setenv("PATH", f"{own.parent}:{os.environ['PATH']}")
    found = installation.find_program()
    assert (found.server, found.prefix, found.version) == (own, None, "11.14.0")
    program(own, "exit 127")
    assert installation.find_program().version == "11.1.0"


def test_the_environment_keeps_what_the_user_has_set(monkeypatch):
    monkeypatch.setenv("GAZEBO_MODEL_PATH", "/mine")
    monkeypatch.delenv("LD_LIBRARY_PATH", raising=False)
    unpacked = environment(Path("/p"), Path("/plugin"))
    assert unpacked["GAZEBO_MODEL_PATH"] == "/p/usr/share/gazebo-11/models:/mine"
    assert unpacked["GAZEBO_MODEL_DATABASE_URI"] == ""
    assert not unpacked["LD_LIBRARY_PATH"].endswith(":")  # that would add the current folder
    assert "LD_LIBRARY_PATH" not in environment(None, None)


# Mirrors


STANZAS = """\
# Debian's
Types: deb deb-src
URIs: http://one.example/debian
  http://two.example/debian
Suites: bookworm bookworm-updates
Components: main
Signed-By: /some/keyring.gpg

Types: deb
URIs: http://one.example/debian-security
Suites: bookworm-security
Components: main

Enabled: no
Types: deb
URIs: http://off.example/debian
Suites: bookworm
Components: main
"""

LINES = """\
# deb http://comment.example/debian bookworm main
deb-src http://source.example/debian bookworm main
deb http://other.example/robots stable robots
deb http://one.example/debian-security bookworm-security main
deb [arch=amd64 signed-by=/some/keyring.gpg] http://one.example/debian bookworm contrib main # ours
deb\thttp://two.example/debian   sid main
"""


def test_mirrors_of_debian_are_distinguished_from_other_sources():
    assert mirrors_in_sources(STANZAS) == ["http://one.example/debian", "http://two.example/debian"]
    assert mirrors_in_list(LINES) == ["http://one.example/debian", "http://two.example/debian"]


def test_the_mirror_of_the_machine(tmp_path):
    with pytest.raises(UprightError, match="no mirror of Debian's archive; name one with --mirror"):
        machine_mirror(tmp_path)
    parts = tmp_path / "sources.list.d"
    parts.mkdir()
    (parts / "debian.sources").write_text(STANZAS.replace("one.", "stanza."))
    (tmp_path / "sources.list").write_text("deb http://ubuntu.example/ubuntu noble main\n")
    assert machine_mirror(tmp_path) == "http://stanza.example/debian"
    (tmp_path / "sources.list").write_text(LINES)
    assert machine_mirror(tmp_path) == "http://one.example/debian"


@pytest.mark.parametrize(
    "mirror", ["", "mirror.example", "ssh://mirror.example", "http://a b", "-o"]
)
def test_a_bad_mirror_is_refused(folder, mirror, capsys):
    assert run(["gazebo", "install", f"--mirror={mirror}"]) == 2
    assert f"mirror is {mirror!r}; it must be" in capsys.readouterr().err
    assert not folder.exists()


# apt


def test_the_output_of_apt_is_parsed():
    steps = """\
Reading package lists...
Inst libc6 (2.31 Debian:11 [amd64])
Inst gazebo (11.1.0+dfsg-6 Debian:11 [amd64]) []
Conf gazebo (11.1.0+dfsg-6 Debian:11 [amd64])
"""
    assert parse_names(steps) == ["libc6", "gazebo"]
    shown = """\
Package: zlib1g
Version: 1:1.2.11
Installed-Size: 165
Architecture: amd64
Depends: libc6,
 libother
Size: 91400
SHA256: 03d2

Package: gazebo-common
Version: 11.1.0
Installed-Size: 1
Architecture: all
Size: 7
SHA256: aa
"""
    assert parse_packages(shown) == [
        Package("zlib1g", "zlib1g_1%3a1.2.11_amd64.deb", 91400, 168960, "03d2"),
        Package("gazebo-common", "gazebo-common_11.1.0_all.deb", 7, 1024, "aa"),
    ]


def test_the_reason_is_the_first_error():
    assert reason("Get:1\nE: no network\nE: more\n") == "E: no network"
    assert reason("a.cc:1: fatal error: x.hh missing\nmake: stopped\n").startswith("a.cc:1")
    assert reason("one\ntwo\n") == "two"
    assert reason("") == "no output"


@needs_debian
@pytest.mark.parametrize(("release", "why"), [(None, "Release file"), ("Suite: x\n", "not signed")])
def test_an_archive_that_debian_did_not_sign_is_refused(folder, tmp_path, release, why):
    place = tmp_path / "mirror/dists/bullseye"
    place.mkdir(parents=True)
    if release:
        (place / "Release").write_text(release)
    folder.mkdir()
    with pytest.raises(UprightError, match=f"{why}.*--mirror names another"):
        install_packages(f"file://{tmp_path}/mirror")


# Unpacking


@pytest.fixture
def archive(folder, tmp_path, monkeypatch):
    """Provide three small packages, which apt seems to download one after the other."""
    packages = [deb(tmp_path, name) for name in ("one", "two", "three")]
    fetched = []

    def fetch(apt, wanted):
        for package in wanted:
            shutil.copy(tmp_path / package.file, apt.archives)
            fetched.append(package.name)
            if fetched == ["one"]:
                raise KeyboardInterrupt

    monkeypatch.setattr(Apt, "update", lambda apt: None)
    monkeypatch.setattr(Apt, "plan", lambda apt: packages)
    monkeypatch.setattr(Apt, "download", fetch)
    folder.mkdir()
    return fetched


def deb(place, name):
    tree = place / name
    (tree / "DEBIAN").mkdir(parents=True)
    (tree / "usr/share").mkdir(parents=True)
    (tree / "usr/share" / name).write_text(name)
    (tree / "DEBIAN/control").write_text(
        f"Package: {name}\nVersion: 1\nArchitecture: all\nMaintainer: x <x@mail.example>\n"
        "Description: x\n"
    )
    path = place / f"{name}_1_all.deb"
    subprocess.run(["dpkg-deb", "--build", tree, path], check=True, capture_output=True)
    data = path.read_bytes()
    return Package(name, path.name, len(data), 4096, hashlib.sha256(data).hexdigest())


@needs_debian
def test_an_interrupted_installation_can_be_resumed(folder, archive, tmp_path, capsys):
    with pytest.raises(KeyboardInterrupt):
        install_packages("http://mirror.example/debian")
    assert not (folder / "complete").exists()
    install_packages("http://mirror.example/debian")
    assert archive == ["one", "two", "three"]
    assert {path.name for path in (folder / "prefix/usr/share").iterdir()} == {*archive}
    assert (folder / "complete").exists()
    assert not (folder / "apt").exists()
    assert capsys.readouterr().out.startswith("Gazebo 11: 3 packages, 0 MB to download, 0 MB on")


@needs_debian
def test_unpacked_packages_are_not_unpacked_again(folder, archive, tmp_path, monkeypatch):
    unpacked = []
    real = installer._run

    def fails_once(command):
        unpacked.append(Path(command[2]).name)
        if len(unpacked) == 2:
            raise UprightError("the disk is full")
        return real(command)

    archive.append("nothing")  # not interrupted
    monkeypatch.setattr(installer, "_run", fails_once)
    with pytest.raises(UprightError, match="full"):
        install_packages("http://mirror.example/debian")
    install_packages("http://mirror.example/debian")
    names = [name.split("_")[0] for name in unpacked]
    assert names == ["one", "two", "two", "three"]
    assert archive == ["nothing", "one", "two", "three"]


@needs_debian
def test_a_damaged_package_is_fetched_again(folder, archive, tmp_path):
    with pytest.raises(KeyboardInterrupt):
        install_packages("http://mirror.example/debian")
    first = folder / "apt/archives/one_1_all.deb"
    first.write_bytes(bytes(first.stat().st_size))
    install_packages("http://mirror.example/debian")
    assert archive == ["one", "one", "two", "three"]


@needs_debian
def test_a_full_disk_is_reported_before_the_download(folder, archive, monkeypatch):
    monkeypatch.setattr(installer, "SPARE", 10**18)
    with pytest.raises(UprightError, match=r"free; Gazebo 11 needs 1000000000\.0 GB"):
        install_packages("http://mirror.example/debian")
    assert archive == []


def test_other_processors_are_refused(folder, monkeypatch):
    monkeypatch.setattr("platform.machine", lambda: "riscv64")
    with pytest.raises(UprightError, match="processor is 'riscv64'"):
        install_packages("http://mirror.example/debian")


# Building


def test_missing_programs_are_named(folder, tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("PATH", str(tmp_path))
    assert run(["gazebo", "install"]) == 2
    assert "cmake and make and c++ missing" in (told := capsys.readouterr().err)
    assert told.endswith("apt-get install cmake make g++\n")


def test_the_plugin_is_built_once(folder, tmp_path, monkeypatch, capsys):
    unpacked_gazebo(folder)
    (folder / "build/of-a-killed-one").mkdir(parents=True)
    called = tmp_path / "called"
    program(
        tmp_path / "bin/cmake",
        f'echo "$@" >>{called}\nif [ "$1" = --build ]; then echo made >"$2/{LIBRARY}"; fi',
    )
    for name in ("make", "c++"):
        program(tmp_path / "bin" / name, "exit 0")
    monkeypatch.setenv("PATH", f"{tmp_path}/bin:{os.environ['PATH']}")
    for _ in range(2):
        assert run(["gazebo", "install"]) == 0
    lines = called.read_text().splitlines()
    assert len(lines) == 2
    assert f"-DGAZEBO_PREFIX={folder}/prefix -DCMAKE_BUILD_TYPE=Release" in lines[0]
    assert find_gazebo().plugin.read_text() == "made\n"
    assert not (folder / "build").exists()
    assert capsys.readouterr().out.count("building the plugin") == 1
    # The compiler's complaint is handed on.
    (installation.sources() / "stepper.cc").write_text("int two\n")
    program(tmp_path / "bin/cmake", "echo 'stepper.cc:1: error: expected ;' >&2; exit 1")
    assert run(["gazebo", "install"]) == 2
    assert "cmake exited with status 1: stepper.cc:1: error" in capsys.readouterr().err


def test_missing_headers_are_reported(folder, tmp_path):
    server = tmp_path / "own/bin/gzserver"
    own = installation.Program(server.parents[1], None, "11.14.0")
    with pytest.raises(UprightError, match=r"headers .* apt-get install libgazebo-dev"):
        installer.build(own)


# One at a time, and removing


def test_two_installations_exclude_each_other(folder):
    folder.mkdir()
    with open(folder / "lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        with pytest.raises(UprightError, match="another installation is in progress"):
            installer.install()
        with pytest.raises(UprightError, match="another installation is in progress"):
            remove()


def test_uninstalling_removes_only_what_was_installed(folder, capsys):
    assert run(["gazebo", "install", "--remove"]) == 0
    unpacked_gazebo(folder)
    (folder / "prefix/large").write_bytes(bytes(3_000_000))
    (folder / "prefix/same").hardlink_to(folder / "prefix/large")
    (folder / "lock").touch()
    (folder / "mine").touch()
    assert run(["gazebo", "install", "--remove"]) == 0
    assert [path.name for path in folder.iterdir()] == ["mine"]
    (folder / "mine").unlink()
    (folder / "lock").touch()
    assert run(["gazebo", "install", "--remove"]) == 0
    assert not folder.exists()
    assert capsys.readouterr().out == "freed: 0 MB\nfreed: 3 MB\nfreed: 0 MB\n"


# The doctor


def test_the_doctor_on_an_empty_machine(folder, tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("PATH", str(tmp_path))
    assert run(["gazebo", "doctor"]) == 1
    told = capsys.readouterr().out
    assert "missing  Gazebo 11: `upright gazebo install` installs it" in told
    assert "missing  cmake: to build the plugin: apt-get install cmake" in told
    assert "missing  Xvfb: " in told
    assert "disk space" in told
    assert not folder.exists()


def test_the_doctor_is_satisfied_once_everything_is_there(folder, monkeypatch, capsys):
    unpacked_gazebo(folder)
    plugin = installation.find_program().plugin
    assert run(["gazebo", "doctor"]) == 1
    plugin.parent.mkdir(parents=True)
    plugin.touch()
    assert run(["gazebo", "doctor"]) == 0
    assert "found    Gazebo 11: version 11.1.0 runs" in capsys.readouterr().out


# The real one


@pytest.mark.gazebo
def test_the_real_server_runs():
    find_gazebo.cache_clear()
    found = find_gazebo()
    assert found.version.startswith("11.")
    assert found.client.is_file()
    done = subprocess.run(
        ["ldd", found.client], env=os.environ | found.environment, capture_output=True, text=True
    )
    assert "not found" not in done.stdout
