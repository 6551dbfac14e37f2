"""How our kernels are compiled, and where the compiled code is kept.

numba's cache looks at the file of the function itself only, so a kernel that
calls another module's kernel would go on running the old one after a change.
The folder's name therefore carries a digest of our sources.  The cache is
read by unpickling: it lies in a folder of the user's own, mode 0700, and
where that cannot be had nothing is cached.
"""

from __future__ import annotations

import hashlib
import os
import stat
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
from numba import njit
from numba.core.compiler import Compiler
from numba.extending import register_jitable

Function = TypeVar("Function", bound=Callable[..., Any])


def _sources_digest() -> str:
    package = Path(__file__).resolve().parents[1]
    digest = hashlib.sha256(numba.__version__.encode())
    for source in sorted(package.rglob("*.py")):
        digest.update(source.read_bytes())
    return digest.hexdigest()[:16]


def _private_folder() -> Path | None:
    """The user's own cache folder, or None where it is not theirs alone."""
    base = os.environ.get("XDG_CACHE_HOME") or "~/.cache"
    folder = Path(base).expanduser() / "reflectance_fit" / f"kernels-{_sources_digest()}"
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        status = folder.lstat()
        owned = not hasattr(os, "getuid") or status.st_uid == os.getuid()
        if not (owned and stat.S_ISDIR(status.st_mode) and os.access(folder, os.W_OK)):
            return None
        folder.chmod(0o700)
    except (OSError, RuntimeError):  # RuntimeError: no home folder
        return None
    return folder


_FOLDER = _private_folder()


def _compile(
    function: Function,
    *,
    forceinline: bool = False,
    parallel: bool = False,
    cache: bool = True,
    **options: Any,
) -> Function:
    # numba reads the folder when it decorates; other libraries' kernels keep theirs.
    before = numba.config.CACHE_DIR  # type: ignore[attr-defined]
    numba.config.CACHE_DIR = str(_FOLDER or before)  # type: ignore[attr-defined]
    try:
        # numba's type hints do not know all of its options.
        compiled: Any = cast(Any, njit)(
            cache=cache and _FOLDER is not None,
            error_model="numpy",
            forceinline=forceinline,
            parallel=parallel,
            no_cfunc_wrapper=True,
            **options,
        )(function)
        return cast(Function, compiled)
    finally:
        numba.config.CACHE_DIR = before  # type: ignore[attr-defined]


def kernel(function: Function) -> Function:
    """Compile strictly (no fastmath), division by zero as numpy has it, cached when that is safe."""
    return _compile(function)


def threaded(function: Function) -> Function:
    """As ``kernel``, its ``prange`` on all of numba's threads.

    No serial kernel of the same module may have its name: they would share a place in the cache.
    """
    return _compile(function, parallel=True)


def inlined(function: Function) -> Function:
    """As ``kernel``, for small helpers: inlined, because a tuple of arrays is costly to hand over."""
    return _compile(function, forceinline=True)


# Regrouped and fused sums and products; NaN and infinity stay what they are.
_FAST = {"contract", "nsz", "arcp", "reassoc"}


class _ApartCompiler(Compiler):
    """Tells LLVM that no two arrays of a call overlap, or it would not gather from a table in a loop that stores."""

    def define_pipelines(self) -> list[Any]:
        self.state.flags.noalias = True
        return cast(list[Any], super().define_pipelines())  # type: ignore[no-untyped-call]


def apart(function: Function) -> Function:
    """As ``kernel``, for parts of kernels whose arrays must not overlap: more of them than LLVM would tell apart."""
    return _compile(function, pipeline_class=_ApartCompiler)


class _PartCompiler(_ApartCompiler):
    """Makes no machine code: that takes time, and rewrites the loops that callers are to inline and vectorise."""

    def define_pipelines(self) -> list[Any]:
        self.state.flags.no_compile = True
        return super().define_pipelines()

    def compile_extra(self, func: Any) -> Any:
        # numba knows a function by its way in from Python; any builtin that is its own will do.
        found = super().compile_extra(func)  # type: ignore[no-untyped-call]
        found = found._replace(entry_point=[].append)
        found.target_context.insert_user_function(found.entry_point, found.fndesc, [found.library])
        return found


def vectorised(function: Function) -> Function:
    """A part of a ``tracer``, of one lane or with loops over lanes; only other compiled functions can call it.

    Sums and products may be regrouped and fused; NaN and infinity stay.
    """
    return _compile(
        function,
        cache=False,
        no_cpython_wrapper=True,
        forceinline=True,
        fastmath=_FAST,
        pipeline_class=_PartCompiler,
    )


def tracer(function: Function) -> Function:
    """A kernel made of ``vectorised`` functions: its arrays must not overlap; other threads run beside it."""
    return _compile(function, fastmath=_FAST, nogil=True, pipeline_class=_ApartCompiler)


def shared(function: Function) -> Function:
    """Leave a function as it is, and let kernels compile it into themselves.

    Without a way in from Python, which takes as long to compile as a small function where tuples of arrays are handed over.
    """
    decorate = register_jitable(
        error_model="numpy", forceinline=True, no_cpython_wrapper=True, no_cfunc_wrapper=True
    )
    return decorate(function)
