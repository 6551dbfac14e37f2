"""Our scenes rendered by Mitsuba 3, in a process of its own: some versions of LLVM end it."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
import tempfile
from glob import glob
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from render_translation import translated

from reflectance_fit.render.scene import Camera, Scene
from reflectance_fit.render.settings import Mode

Floats = NDArray[np.float64]

SECONDS = 600
THREADS = 2
# There is no variant with Stokes vectors of three channels: scenes for `polarized` are grey, and one channel is compared.
VARIANTS = {
    "scalar": "llvm_ad_mono",
    "rgb": "llvm_ad_rgb",
    "spectral": "llvm_ad_spectral",
    "polarized": "llvm_ad_mono_polarized",
    "spectral_polarized": "llvm_ad_spectral_polarized",
}
LIBRARY = "DRJIT_LIBLLVM_PATH"


def library() -> str | None:
    """LLVM 19, the version that Mitsuba runs with here: 15 ends the process, 14 does with Stokes vectors."""
    named = os.environ.get(LIBRARY)
    if named:
        return named
    found = sorted(
        glob("/usr/lib/*/libLLVM-19.so*")
        + glob("/usr/lib/*/libLLVM.so.19*")
        + glob("/usr/lib/llvm-19/lib/libLLVM*.so*")
    )
    return found[0] if found else None


def child(script: str, job: Any, seconds: float = SECONDS) -> Any:
    """What a script answers to a pickled job, or in a string why it does not."""
    environment = dict(os.environ)
    if (llvm := library()) is not None:
        environment[LIBRARY] = llvm
    with tempfile.TemporaryDirectory() as folder:
        question, answer = Path(folder) / "job", Path(folder) / "answer"
        question.write_bytes(pickle.dumps(job))
        line = [sys.executable, script, str(question), str(answer)]
        try:
            done = subprocess.run(
                line, capture_output=True, text=True, check=False, timeout=seconds, env=environment
            )
        except subprocess.TimeoutExpired:
            return f"no answer within {seconds:.0f} s"
        if done.returncode or not answer.exists():
            said = done.stderr.strip().splitlines()
            return f"its process ended with {done.returncode}: {said[-1] if said else 'it said nothing'}"
        return pickle.loads(answer.read_bytes())


def renders(scene: Scene, mode: Mode, samples: int, seeds: range) -> Floats | str:
    """Independent pictures, shape (seeds, height, width, C, S), in our frame and linear sRGB; or why there are none."""
    if library() is None:
        return f"no LLVM 19 found; install libllvm19 or set {LIBRARY}"
    return child(__file__, (scene, mode, samples, seeds))


def _renders(scene: Scene, mode: Mode, samples: int, seeds: range) -> Floats:
    import drjit
    import mitsuba

    mitsuba.set_log_level(mitsuba.LogLevel.Error)
    mitsuba.set_variant(VARIANTS[mode])
    drjit.set_thread_count(THREADS)
    theirs = mitsuba.load_dict(translated(scene, mode))
    channels = 1 if mode in ("scalar", "polarized") else 3
    found = []
    for seed in seeds:
        picture = np.array(mitsuba.render(theirs, seed=seed, spp=samples), dtype=np.float64)
        if "polarized" in mode:
            stokes = picture[..., -12:].reshape(*picture.shape[:2], 4, 3)
            found.append(_our_frame(scene.camera, np.swapaxes(stokes, -1, -2)[..., :channels, :]))
        else:
            found.append(picture[..., :channels, None])
    return np.array(found)


def _our_frame(camera: Camera, stokes: Floats) -> Floats:
    """From Mitsuba's axis at a pixel, ray x up, to ours: the picture's horizontal, turned into the ray the shortest way."""
    if camera.projection == "orthographic":
        return stokes
    width, height = camera.size_px
    x, y = np.meshgrid(2.0 * np.arange(width) + 1.0 - width, height - 1.0 - 2.0 * np.arange(height))
    tangent = np.tan(np.radians(camera.width) / 2.0) / width
    d = np.stack([x * tangent, y * tangent, np.ones_like(x)], axis=-1)  # right, up, forward
    d /= np.linalg.norm(d, axis=-1, keepdims=True)
    ours = np.array([1.0, 0.0, 0.0]) - (d + np.array([0.0, 0.0, 1.0])) * (d[..., :1] / (1.0 + d[..., 2:]))
    # In these coordinates forward x up = right, so the receiver's vertical is axis x ray.
    theirs = np.stack([d[..., 2], np.zeros_like(x), -d[..., 0]], axis=-1)
    theirs /= np.linalg.norm(theirs, axis=-1, keepdims=True)
    up = _left_cross(theirs, d)
    angle = np.arctan2(np.sum(ours * up, axis=-1), np.sum(ours * theirs, axis=-1))[..., None]
    cos, sin, turned = np.cos(2.0 * angle), np.sin(2.0 * angle), stokes.copy()
    turned[..., 1] = cos * stokes[..., 1] + sin * stokes[..., 2]
    turned[..., 2] = cos * stokes[..., 2] - sin * stokes[..., 1]
    return turned


def _left_cross(a: Floats, b: Floats) -> Floats:
    """a x b in right, up, forward, which is a left-handed order."""
    return -np.cross(a, b)


if __name__ == "__main__":
    Path(sys.argv[2]).write_bytes(pickle.dumps(_renders(*pickle.loads(Path(sys.argv[1]).read_bytes()))))
