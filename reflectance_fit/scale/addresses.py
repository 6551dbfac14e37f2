"""Where a Dask scheduler is, and whether it may be talked to.

A scheduler runs the code that it is sent, and so does whoever answers in its
name: beyond this machine only certificates tell that it is the right one.
"""

from __future__ import annotations

import json
from ipaddress import ip_address
from pathlib import Path
from urllib.parse import urlsplit

from reflectance_fit.errors import Problem, ReflectanceFitError


def scheduler_address(given: str, *, insecure: bool = False) -> str:
    """``tcp://HOST:PORT`` or ``tls://HOST:PORT``, of an address or of the file that a scheduler wrote.

    Raises ReflectanceFitError for what is neither, and, unless ``insecure``,
    for tcp to another host than this one.
    """
    path = Path(given)
    if "://" not in given and path.is_file():
        address = _from_file(path)
    elif "://" in given or (":" in given and "/" not in given):
        address = given
    else:
        raise ReflectanceFitError(
            Problem(given, None, "no such scheduler file; an address looks like tls://HOST:8786")
        )
    address = address if "://" in address else f"tcp://{address}"
    try:
        url = urlsplit(address)
        host, port = url.hostname, url.port
    except ValueError:
        host = port = None
    if host is None or port is None:
        raise ReflectanceFitError(f"'{address}' is not the address of a scheduler, such as tls://HOST:8786")
    if url.scheme not in ("tcp", "tls"):
        raise ReflectanceFitError(f"'{address}': schedulers are reached by tls:// or tcp://")
    if url.scheme == "tcp" and not insecure and not _is_this_machine(host):
        raise ReflectanceFitError(
            f"'{address}' is another machine, and tcp:// is neither encrypted nor authenticated; give the"
            " scheduler certificates and a tls:// address, or trust the network with --insecure-cluster"
        )
    return address


def _from_file(path: Path) -> str:
    try:
        return str(json.loads(path.read_text(encoding="utf-8"))["address"])
    except (ValueError, KeyError, TypeError) as error:
        message = "is no scheduler file; 'dask scheduler --scheduler-file FILE' writes one"
        raise ReflectanceFitError(Problem(str(path), None, message)) from error


def _is_this_machine(host: str) -> bool:
    """Names other than localhost are somebody's word: what they stand for may change."""
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"
