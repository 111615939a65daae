"""What this machine has and lacks. Nothing here crashes for want of a driver or a package."""

import importlib.metadata
import os
import platform
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Literal, NamedTuple

from sum_drake import __version__
from sum_drake.assets import one_line

PACKAGES = (
    "sum-drake", "drake", "numpy", "scipy", "torch", "opencv-python-headless", "trimesh", "ompl", "ruckig", "pyyaml",
    "numba", "safetensors", "fast-simplification", "foxglove-sdk", "mcap",
)  # fmt: skip
EGL_SCRIPT = Path(__file__).with_name("egl.py")
DEBIAN_PACKAGES = "libglib2.0-0 libegl1 libgl1-mesa-dri"


class RenderingError(RuntimeError):
    """This machine cannot render. The message is one line that says what to install."""


class Check(NamedTuple):
    """One line of the diagnosis."""

    name: str
    status: Literal["ok", "warning", "bad"]
    detail: str


def egl_problem() -> str | None:
    """Why RenderEngineVtk cannot render here, in one line that names the Debian packages; None if it can.

    Without a driver Drake does not raise at the first render, it ends the process. EGL is therefore asked first, in a
    process of its own.
    """
    answer = _ask_egl()
    if answer.startswith("ok"):
        return None
    return f"cannot render: {answer}; expected EGL with an OpenGL driver (Debian: apt-get install {DEBIAN_PACKAGES})"


def require_rendering() -> None:
    """Raises RenderingError with the line of `egl_problem` on a machine that cannot render; call before any render."""
    problem = egl_problem()
    if problem is not None:
        raise RenderingError(problem)


def _ask_egl() -> str:
    """One line: "ok: <renderer>" or what is missing."""
    try:
        done = subprocess.run(
            [sys.executable, "-I", str(EGL_SCRIPT)], capture_output=True, text=True, timeout=60, check=False
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        return f"EGL could not be asked ({type(error).__name__})"
    lines = done.stdout.split("\n")
    if done.returncode != 0 or not lines[0]:
        return f"EGL's driver broke when asked (exit status {done.returncode})"
    return lines[0]


def versions() -> dict[str, str]:
    """Versions of Python and of every package that the results depend on; "missing" where there is none."""
    found = {"python": platform.python_version(), "sum-drake": __version__}
    for name in PACKAGES[1:]:
        try:
            found[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            found[name] = "missing"
    return found


def commit() -> str | None:
    """The commit of the checkout that this program runs from, "-dirty" at its end where files differ from it.

    None where it does not run from one, or git is not there to tell.
    """
    root = Path(__file__).resolve().parents[1]
    if not (root / ".git").exists():
        return None
    command = ["git", "-C", os.fspath(root), "describe", "--always", "--dirty", "--abbrev=12", "--exclude=*"]
    try:
        told = subprocess.run(command, capture_output=True, text=True, timeout=10, check=True)
    except (OSError, subprocess.SubprocessError):
        return None
    return told.stdout.strip() or None


def device() -> str:
    """What renders and computes: the processor, and CUDA's device where torch has one."""
    import torch

    name = f"{platform.machine()}, {_processor()}"
    return f"{name}, {torch.cuda.get_device_name()}" if torch.cuda.is_available() else name


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor()
    return next((line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")), "unknown")


def diagnose() -> Iterator[Check]:
    """Everything worth knowing before a first run, in the order in which to read it, each as it is found."""
    for name, version in versions().items():
        yield Check(name, "bad" if version == "missing" else "ok", version)
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30
    yield Check("cores", "ok" if cores >= 2 else "warning", str(cores))
    yield Check("memory", "ok" if memory >= 4 else "warning", f"{memory:.1f} GiB")
    yield _torch()
    yield from _solvers()
    problem = egl_problem()
    yield Check("rendering", "bad" if problem else "ok", problem or _ask_egl().removeprefix("ok: "))
    yield Check("depth render", "bad", "not tried") if problem else _depth_render()


def _torch() -> Check:
    try:
        import torch
    except ImportError as error:
        return Check("torch device", "bad", one_line(error))
    if torch.cuda.is_available():
        return Check("torch device", "ok", f"cuda, {torch.cuda.get_device_name()}")
    return Check("torch device", "ok", f"cpu, {torch.get_num_threads()} threads")


def _solvers() -> list[Check]:
    try:
        from pydrake.solvers import IpoptSolver, SnoptSolver
    except ImportError as error:
        return [Check("solvers", "bad", one_line(error))]
    return [
        Check(name, "ok" if solver.available() and solver.enabled() else "warning", words)
        for name, solver, words in (
            ("SNOPT", SnoptSolver(), "nonlinear programs"),
            ("IPOPT", IpoptSolver(), "nonlinear programs, where there is no SNOPT"),
        )
    ]


def _depth_render() -> Check:
    """Renders a sphere one metre away at 640 x 480, and times it once everything is warm."""
    try:
        from pydrake.geometry import (
            ClippingRange,
            DepthRange,
            DepthRenderCamera,
            GeometryInstance,
            MakePhongIllustrationProperties,
            MakeRenderEngineVtk,
            PerceptionProperties,
            RenderCameraCore,
            RenderEngineVtkParams,
            Rgba,
            SceneGraph,
            Sphere,
        )
        from pydrake.math import RigidTransform
        from pydrake.systems.sensors import CameraInfo
    except ImportError as error:
        return Check("depth render", "bad", one_line(error))
    scene_graph = SceneGraph()
    scene_graph.AddRenderer("vtk", MakeRenderEngineVtk(RenderEngineVtkParams()))
    ball = GeometryInstance(RigidTransform([0.0, 0.0, 1.0]), Sphere(0.2), "ball")
    ball.set_illustration_properties(MakePhongIllustrationProperties(Rgba(1, 1, 1).rgba))
    ball.set_perception_properties(PerceptionProperties())
    scene_graph.RegisterAnchoredGeometry(scene_graph.RegisterSource("doctor"), ball)
    query = scene_graph.get_query_output_port().Eval(scene_graph.CreateDefaultContext())
    core = RenderCameraCore("vtk", CameraInfo(640, 480, 1.0), ClippingRange(0.1, 5.0), RigidTransform())
    camera = DepthRenderCamera(core, DepthRange(0.2, 4.0))

    def render() -> float:
        image = query.RenderDepthImage(camera, scene_graph.world_frame_id(), RigidTransform())
        return float(image.data[240, 320, 0])

    depth = render()
    start = time.perf_counter()
    for _ in range(5):
        render()
    milliseconds = (time.perf_counter() - start) / 5 * 1e3
    if abs(depth - 0.8) > 0.005:
        return Check("depth render", "warning", f"a sphere 0.8 m away was seen at {depth:.3f} m")
    return Check("depth render", "ok", f"640 x 480 in {milliseconds:.1f} ms")


def format_checks(checks: Sequence[Check]) -> str:
    """A diagnosis, or a part of one, as aligned text, one line each."""
    width = max(map(len, PACKAGES))  # no other name is as long
    return "\n".join(f"{c.status:8} {c.name:{width}}  {c.detail}" for c in checks)
