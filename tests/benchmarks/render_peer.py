"""Mitsuba's renders on demand: a process for each variant, as some versions of LLVM end theirs."""

from __future__ import annotations

import json
import os
import pickle
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

sys.path.append(str(Path(__file__).parents[1] / "scorecard"))

from render_mitsuba import LIBRARY, THREADS, library
from render_translation import translated

from reflectance_fit.render.scene import Scene
from reflectance_fit.render.settings import Mode


class Peer:
    """One variant with a scene loaded; ``why`` it is not, if it is not."""

    def __init__(self, variant: str, scene: Scene, mode: Mode) -> None:
        environment = dict(os.environ)
        found = library()
        self.why = ""
        if found is not None:
            environment[LIBRARY] = found
        elif variant.startswith("llvm"):
            self.why = f"no LLVM 19 found; install libllvm19 or set {LIBRARY}"
            return
        with tempfile.NamedTemporaryFile(suffix=".scene") as file:
            file.write(pickle.dumps((variant, scene, mode)))
            file.flush()
            self._process = subprocess.Popen(
                [sys.executable, __file__, file.name],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                text=True,
                env=environment,
            )
            self._answer()

    def render(self, samples: int, seed: int) -> float:
        """Seconds for a picture."""
        self._ask({"samples": samples, "seed": seed})
        return float(self._answer().get("seconds", np.nan))

    def variance(self, samples: int, seeds: int) -> float:
        """Of one sample: the median over pixels of the variance between pictures, times their samples."""
        self._ask({"samples": samples, "seeds": seeds})
        return float(self._answer().get("variance", np.nan))

    def close(self) -> None:
        if not self.why:
            self._process.communicate()

    def _ask(self, question: dict[str, int]) -> None:
        if self.why:
            return
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps(question) + "\n")
        self._process.stdin.flush()

    def _answer(self) -> dict[str, Any]:
        if self.why:
            return {}
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if line:
            return dict(json.loads(line))
        self.why = f"its process ended with {self._process.wait()}"
        return {}


def sample_variance(pictures: Any, samples: int) -> float:
    """Of one sample: the median over pixels and channels with noise of the variance between pictures."""
    spread = np.var(np.asarray(pictures), axis=0, ddof=1)
    return float(np.median(spread[spread > 0.0])) * samples


def _serve(variant: str, scene: Scene, mode: Mode) -> None:
    import drjit
    import mitsuba

    mitsuba.set_log_level(mitsuba.LogLevel.Error)
    mitsuba.set_variant(variant)
    drjit.set_thread_count(THREADS)
    loaded = mitsuba.load_dict(translated(scene, mode))

    def picture(samples: int, seed: int) -> Any:
        return np.array(mitsuba.render(loaded, seed=seed, spp=samples))

    print(json.dumps({}), flush=True)
    for line in sys.stdin:
        question = json.loads(line)
        if "seeds" in question:
            pictures = [picture(question["samples"], seed)[..., :3] for seed in range(question["seeds"])]
            answer = {"variance": sample_variance(pictures, question["samples"])}
        else:
            started = time.perf_counter()
            picture(question["samples"], question["seed"])
            answer = {"seconds": time.perf_counter() - started}
        print(json.dumps(answer), flush=True)


if __name__ == "__main__":
    _serve(*pickle.loads(Path(sys.argv[1]).read_bytes()))
