"""The process that runs tasks: what ``processes`` starts."""

from __future__ import annotations

import os
import pickle
import resource
import select
import signal
import threading
import traceback
from multiprocessing.connection import Connection

from reflectance_fit.scale.executors import Answer, attempt, reason


def serve(descriptor: int) -> None:
    """Answer pickled (call, args) with pickled Answers until the other side closes.

    The first answer, None, says that the process is up.  When the other
    side's process ends, however it ends, so does this one, amid a task too.
    """
    # An interrupt is the parent's to handle; it ends its workers.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # A task may be a crash; a core file each would fill the disk.
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    # What a task has to say travels as its answer.
    with open(os.devnull, "wb") as nothing:
        os.dup2(nothing.fileno(), 2)
    threading.Thread(target=_end_with_parent, args=(descriptor,), daemon=True).start()
    connection = Connection(descriptor)
    connection.send_bytes(pickle.dumps(None))
    while True:
        try:
            job = connection.recv_bytes()
        except EOFError:
            return
        connection.send_bytes(_answer(job))


def _answer(job: bytes) -> bytes:
    try:
        return pickle.dumps(attempt(*pickle.loads(job)))
    except Exception as error:  # noqa: BLE001  what cannot be pickled, or imported, is a failure too
        return pickle.dumps(Answer(None, reason(error), traceback.format_exc()))


def _end_with_parent(descriptor: int) -> None:
    hang_up = select.poll()
    hang_up.register(descriptor, 0)  # asks for nothing but what is always told: that the pipe is closed
    hang_up.poll()
    os._exit(1)
