"""The doctor: a missing driver is one clear line, never a crash."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from sum_drake import doctor, egl


@pytest.fixture(params=["no vendor", "no driver"])
def no_driver(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An environment in which EGL really finds no driver: Drake ends with SIGSEGV at its first render in both."""
    if request.param == "no vendor":
        monkeypatch.setenv("__EGL_VENDOR_LIBRARY_FILENAMES", str(tmp_path / "nothing.json"))
    else:
        monkeypatch.setenv("LIBGL_DRIVERS_PATH", str(tmp_path))


def test_the_commit_is_that_of_the_checkout_or_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def git(*arguments: str) -> str:
        command = ["git", "-C", str(tmp_path), "-c", "user.name=a", "-c", "user.email=b", *arguments]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()

    monkeypatch.setattr(doctor, "__file__", str(tmp_path / "sum_drake" / "doctor.py"))
    assert doctor.commit() is None
    (tmp_path / "a.py").write_text("a = 1\n")
    git("init", "-q")
    assert doctor.commit() is None, "there is none yet"
    git("add", "-A")
    git("commit", "-qm", "a")
    told = doctor.commit()
    assert told is not None and git("rev-parse", "HEAD").startswith(told) and len(told) == 12
    (tmp_path / "a.py").write_text("a = 2\n")
    assert doctor.commit() == f"{told}-dirty"
    monkeypatch.setenv("PATH", "")
    assert doctor.commit() is None


def test_this_machine_renders() -> None:
    assert doctor.egl_problem() is None
    doctor.require_rendering()


@pytest.mark.usefixtures("no_driver")
def test_a_missing_driver_is_one_line() -> None:
    problem = doctor.egl_problem()
    assert problem is not None and "\n" not in problem
    assert "libglib2.0-0 libegl1 libgl1-mesa-dri" in problem
    with pytest.raises(doctor.RenderingError, match="libgl1-mesa-dri"):
        doctor.require_rendering()


@pytest.mark.usefixtures("no_driver")
def test_the_whole_diagnosis_survives_a_missing_driver() -> None:
    checks = {check.name: check for check in doctor.diagnose()}
    assert checks["rendering"].status == "bad"
    assert checks["depth render"].status == "bad"
    assert checks["drake"].status == "ok"


def test_a_driver_that_crashes_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A vendor library that kills whoever loads it kills the probe's process only."""
    crash = tmp_path / "crash.py"
    crash.write_text("import os, signal\nos.kill(os.getpid(), signal.SIGSEGV)\n")
    monkeypatch.setattr(doctor, "EGL_SCRIPT", crash)
    problem = doctor.egl_problem()
    assert problem is not None and "\n" not in problem and "broke when asked" in problem


def test_a_missing_library_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    def load(name: str) -> None:
        raise OSError(f"{name}: cannot open shared object file: No such file or directory")

    monkeypatch.setattr(egl.ctypes, "CDLL", load)
    assert "libglib-2.0.so.0" in egl.probe()


def test_the_probe_needs_nothing_of_the_package(tmp_path: Path) -> None:
    """It runs before anything else is known to work, even on a bare interpreter."""
    done = subprocess.run(
        [sys.executable, "-I", "-S", os.fspath(egl.__file__)], capture_output=True, text=True, cwd=tmp_path, check=True
    )
    assert done.stdout.count("\n") == 1


def test_diagnosis() -> None:
    checks = {check.name: check for check in doctor.diagnose()}
    assert checks["depth render"].status == "ok" and "ms" in checks["depth render"].detail
    assert {"python", "drake", "torch", "cores", "memory", "SNOPT", "IPOPT"} <= set(checks)
    text = doctor.format_checks(list(checks.values()))
    assert len(text.splitlines()) == len(checks)
    assert not any(line.endswith(" ") for line in text.splitlines())


def test_a_missing_package_is_bad(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "PACKAGES", ("numpy", "no-such-package"))
    assert doctor.versions()["no-such-package"] == "missing"
    statuses = {check.name: check.status for check in doctor.diagnose()}
    assert statuses["no-such-package"] == "bad"
