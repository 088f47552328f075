"""Tests of removing the shared memory of killed processes at the next start; memory in use is kept."""

import fcntl
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from sar_compiler.ros.middleware import _remove_if_stale, remove_stale_segments

STARTING_PROCESS = """
import rclpy
from sar_compiler.ros.middleware import ros_up
with ros_up([]) as context:
    rclpy.create_node("begins", context=context)
"""
RUNNING_PROCESS = "import rclpy; rclpy.init(); node = rclpy.create_node('alive'); print(flush=True); input()"


def leave_segment(folder: Path, name: str, *, age_sec: float = 3600.0) -> Path:
    """Create a segment and its lock, as a killed process leaves them."""
    segment = folder / f"fastrtps_{name}"
    segment.write_bytes(b"0" * 1000)
    lock = folder / f"fastrtps_{name}_el"
    lock.touch()
    then = lock.stat().st_mtime - age_sec
    os.utime(lock, (then, then))
    return segment


def test_segments_of_killed_processes_are_removed_with_locks(tmp_path: Path) -> None:
    for name in ("a", "b"):
        leave_segment(tmp_path, name)
    assert remove_stale_segments(tmp_path) == 2
    assert list(tmp_path.iterdir()) == []


def test_locked_new_and_foreign_files_are_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    held, new = leave_segment(tmp_path, "held"), leave_segment(tmp_path, "new", age_sec=0.0)
    (tmp_path / "fastrtps_port7412").write_bytes(b"port")
    with Path(f"{held}_el").open("rb") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        assert remove_stale_segments(tmp_path) == 0
    monkeypatch.setattr("os.geteuid", lambda: 4711)
    assert remove_stale_segments(tmp_path) == 0
    assert held.exists()
    assert new.exists()
    assert len(list(tmp_path.iterdir())) == 5


def test_ports_of_killed_processes_are_kept(tmp_path: Path) -> None:
    leave_segment(tmp_path, "port7009")
    assert remove_stale_segments(tmp_path) == 0
    assert sorted(each.name for each in tmp_path.iterdir()) == ["fastrtps_port7009", "fastrtps_port7009_el"]


def leave_empty_file(folder: Path, name: str, *, age_sec: float = 60.0) -> Path:
    """Create a file of size zero, as a process leaves it that is killed before it sets the size."""
    file = folder / f"fastrtps_{name}"
    file.touch()
    then = file.stat().st_mtime - age_sec
    os.utime(file, (then, then))
    return file


def test_port_left_empty_by_killed_process_is_removed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    port, segment = leave_empty_file(tmp_path, "port30693"), leave_empty_file(tmp_path, "1fe2c0ae1279fc6f")
    new = leave_empty_file(tmp_path, "port30695", age_sec=0.0)
    leave_empty_file(tmp_path, "target")
    link = tmp_path / "fastrtps_port30697"
    link.symlink_to("fastrtps_target")
    monkeypatch.setattr("os.geteuid", lambda: 4711)
    assert remove_stale_segments(tmp_path) == 0
    monkeypatch.undo()
    assert remove_stale_segments(tmp_path) == 3
    assert not port.exists()
    assert not segment.exists()
    assert new.exists()
    assert link.is_symlink()


@pytest.mark.ros
def test_process_starts_despite_ports_left_empty_by_killed_process() -> None:
    """Without the removal, the first node would wait in native code until its process is killed."""
    folder = Path("/dev/shm")  # noqa: S108 - shared memory of Linux
    first = 7400 + 250 * int(os.environ["ROS_DOMAIN_ID"]) + 11
    ports = [f"port{first + 2 * participant}" for participant in range(20)]
    made = [leave_empty_file(folder, port) for port in ports if not (folder / f"fastrtps_{port}").exists()]
    assert made, "no port of this domain is free"
    try:
        subprocess.run([sys.executable, "-c", STARTING_PROCESS], check=True, timeout=120.0)
    finally:
        for each in made:
            remains_empty = each.exists() and not each.stat().st_size
            if remains_empty:
                each.unlink()


@pytest.mark.ros
def test_files_of_participant_are_kept_until_it_is_killed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("sar_compiler.ros.middleware._NEW_SEC", 0.0)
    folder = Path("/dev/shm")  # noqa: S108 - shared memory of Linux
    before = set(folder.glob("fastrtps_*_el"))
    process = subprocess.Popen(
        [sys.executable, "-c", RUNNING_PROCESS], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )
    assert process.stdout is not None
    process.stdout.readline()
    opened = {each.readlink() for each in Path(f"/proc/{process.pid}/fd").iterdir()}
    held = {each for each in opened & set(folder.glob("fastrtps_*_el")) - before if "_port" not in each.name}
    assert held, "Fast DDS holds no lock: its names have changed"
    assert not any(_remove_if_stale(each) for each in held)
    assert all(each.exists() for each in held)
    process.send_signal(signal.SIGKILL)
    process.communicate()
    assert all(_remove_if_stale(each) for each in held)
    assert not any(each.exists() for each in held)
