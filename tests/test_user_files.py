"""Files of users: nothing but files is read, and nothing is waited for."""

import os
from pathlib import Path

import pytest

from infoplan.errors import UsageError
from infoplan.files import read_regular, user_path


def test_a_file_is_read_up_to_its_limit(tmp_path):
    path = tmp_path / "file"
    path.write_bytes(b"12345")
    assert read_regular(path, 5) == b"12345"
    with pytest.raises(UsageError, match="5 bytes, more than the 4"):
        read_regular(path, 4)


def test_pipes_folders_and_devices_are_named(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for path, kind in ((tmp_path / "pipe", "named pipe"), (tmp_path, "folder"),
                       (Path("/dev/zero"), "device")):  # fmt: skip
        with pytest.raises(UsageError, match=f"is a {kind}"):
            read_regular(path, 100)


def test_a_file_that_tells_no_size_is_bounded():
    with pytest.raises(UsageError, match="more than the 10 bytes"):
        read_regular(Path("/proc/self/maps"), 10)


def test_links_that_lead_nowhere_are_errors_of_the_system(tmp_path):
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    with pytest.raises(OSError, match="loop"):
        read_regular(tmp_path / "loop", 10)


def test_homes(monkeypatch):
    monkeypatch.setenv("HOME", "/somewhere")
    assert user_path("~/maps") == Path("/somewhere/maps")
    assert user_path("~no-such-user-here/maps") == Path("~no-such-user-here/maps")
