"""Whom a scheduler's address leads to: this machine, a certificate, or nobody."""

import json

import pytest

from reflectance_fit.errors import ReflectanceFitError
from reflectance_fit.scale.addresses import scheduler_address

HERE = ["127.0.0.1:8786", "localhost:8786", "tcp://127.8.9.1:1", "tcp://[::1]:8786", "tcp://localhost:8786"]
ELSEWHERE = [
    "10.0.0.7:8786",
    "tcp://10.0.0.7:8786",
    "tcp://0.0.0.0:8786",
    "tcp://[fe80::1]:8786",
    "tcp://lab.example:8786",
    "tcp://localhost.lab.example:8786",
    "tcp://127.0.0.1.lab.example:8786",
    "tcp://127.0.0.1@10.0.0.7:8786",
    "TCP://10.0.0.7:8786",
]


@pytest.mark.parametrize("given", HERE)
def test_tcp_on_this_machine(given):
    assert scheduler_address(given) == (given if "://" in given else f"tcp://{given}")


@pytest.mark.parametrize("given", ELSEWHERE)
def test_tcp_to_another_machine_needs_to_be_asked_for(given):
    with pytest.raises(ReflectanceFitError, match=r"another machine.*--insecure-cluster") as caught:
        scheduler_address(given)
    assert len(caught.value.lines()) == 1
    assert scheduler_address(given, insecure=True).endswith(given)


@pytest.mark.parametrize("given", ["tls://10.0.0.7:8786", "tls://lab.example:8786", "tls://127.0.0.1:8786"])
def test_tls_goes_anywhere(given):
    assert scheduler_address(given) == given


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ("missing.json", "no such scheduler file"),
        ("", "no such scheduler file"),
        ("a/b:c", "no such scheduler file"),
        ("tcp://127.0.0.1", "not the address of a scheduler"),
        ("tcp://127.0.0.1:port", "not the address of a scheduler"),
        ("tcp://127.0.0.1:99999", "not the address of a scheduler"),
        ("tls://:8786", "not the address of a scheduler"),
        ("tls://[::1:8786", "not the address of a scheduler"),
        ("ws://127.0.0.1:8786", "tls:// or tcp://"),
        ("inproc://127.0.0.1:8786", "tls:// or tcp://"),
    ],
)
def test_what_is_no_address(given, message):
    with pytest.raises(ReflectanceFitError, match=message):
        scheduler_address(given, insecure=True)


def test_a_schedulers_file_is_held_to_the_same(tmp_path):
    file = tmp_path / "scheduler.json"
    file.write_text(json.dumps({"type": "Scheduler", "address": "tcp://127.0.0.1:8786"}))
    assert scheduler_address(str(file)) == "tcp://127.0.0.1:8786"
    file.write_text(json.dumps({"type": "Scheduler", "address": "tcp://10.0.0.7:8786"}))
    with pytest.raises(ReflectanceFitError, match="another machine"):
        scheduler_address(str(file))
    for text in ("", "{}", "[]", "tcp://127.0.0.1:8786"):
        file.write_text(text)
        with pytest.raises(ReflectanceFitError, match="is no scheduler file"):
            scheduler_address(str(file))
