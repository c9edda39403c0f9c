"""The explorer's connections: unfinished requests shut out nobody, and the server ends at once with all it started."""

import http.client
import json
import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from contextlib import contextmanager, suppress

import psutil
import pytest
import uvicorn

from chuteflow.explorer import connections
from chuteflow.explorer.connections import Connection, Server
from chuteflow.explorer.server import application, bind_socket


@contextmanager
def serving(compute):
    """The port of a server in a thread of this process."""
    listener = bind_socket("127.0.0.1", 0)
    served = application(compute=compute)
    server = Server(
        uvicorn.Config(served, http=Connection, ws="none", log_level="error", lifespan="on"),
        served.state.scheduler.close,
    )
    thread = threading.Thread(target=server.run, kwargs={"sockets": [listener]})
    thread.start()
    try:
        yield listener.getsockname()[1]
    finally:
        server.should_exit = True
        thread.join(20)
        assert not thread.is_alive()


def status(port, path="/about", source="127.0.0.1"):
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=10, source_address=(source, 0))
    try:
        connection.request("GET", path)
        return connection.getresponse().status
    finally:
        connection.close()


def trickle(one):
    """Send a byte now and then, which does not keep a connection, until it is closed."""
    until = time.monotonic() + 10.0
    with suppress(OSError):
        while time.monotonic() < until:
            one.sendall(b"x")
            time.sleep(0.1)


def last_words(one):
    """Status and error of what the server said before it closed a connection."""
    one.settimeout(10)
    said = b""
    while part := one.recv(65536):
        said += part
    head, _, body = said.partition(b"\r\n\r\n")
    return int(head.split()[1]), json.loads(body)["error"]


def test_four_hundred_half_sent_requests_shut_out_nobody(compute, half_sent):
    with serving(compute) as port, half_sent(port, 400) as those:
        assert {status(port, source=source) for source in ("127.0.0.1", "127.0.0.2") for _ in range(20)} == {200}
        # Those that came first are told why they are dropped.
        said = last_words(those[0])
        assert said == (503, "127.0.0.1 has more than 32 unfinished requests: finish them first")
        # The last ones may still finish.
        those[-1].sendall(b"x\r\n\r\n")
        assert those[-1].recv(12) == b"HTTP/1.1 200"


def test_who_floods_is_dropped_and_no_other(compute, half_sent):
    with serving(compute) as port, half_sent(port, 20, "127.0.0.2") as others, half_sent(port, 100):
        time.sleep(2.5)
        for one in others:
            one.sendall(b"x\r\n\r\n")
            assert one.recv(12) == b"HTTP/1.1 200"


def test_where_there_is_no_room_the_client_with_the_most_connections_gives_it(compute, monkeypatch, half_sent):
    monkeypatch.setattr(connections, "connection_limit", lambda: 50)
    with serving(compute) as port, half_sent(port, 48), half_sent(port, 10, "127.0.0.2") as others:
        assert status(port, source="127.0.0.2") == 200
        for one in others:
            one.sendall(b"x\r\n\r\n")
            assert one.recv(12) == b"HTTP/1.1 200"


def test_a_request_has_so_much_time_and_no_more(compute, monkeypatch, half_sent):
    monkeypatch.setattr(connections, "_REQUEST", 0.5)
    with serving(compute) as port, half_sent(port, 2) as (silent, slow):
        began = time.monotonic()
        trickle(slow)
        assert last_words(silent) == (408, "the request was not complete within 0.5 seconds")
        assert time.monotonic() - began < 5.0


def test_a_body_that_never_ends_is_not_waited_for(compute, monkeypatch):
    monkeypatch.setattr(connections, "_REQUEST", 0.5)
    with serving(compute) as port, socket.create_connection(("127.0.0.1", port), 10) as one:
        one.sendall(b"POST /about HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 1000000\r\n\r\n")
        assert one.recv(12) == b"HTTP/1.1 405"
        began = time.monotonic()
        trickle(one)
        assert time.monotonic() - began < 5.0


def test_an_answer_that_is_not_taken_is_given_up(compute, monkeypatch):
    monkeypatch.setattr(connections, "_ANSWER", 0.5)
    with serving(compute) as port, socket.create_connection(("127.0.0.1", port), 10) as one:
        one.sendall(b"GET /ask/map?do=nap&seconds=8 HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
        assert one.recv(1) == b""


def test_there_are_fewer_connections_than_files_allowed(monkeypatch):
    resource = pytest.importorskip("resource")
    for files, count in ((256, 192), (1_000_000, 512), (resource.RLIM_INFINITY, 512), (10, 8)):
        monkeypatch.setattr(resource, "getrlimit", lambda which, n=files: (n, n))
        assert connections.connection_limit() == count
    monkeypatch.setitem(sys.modules, "resource", None)
    assert connections.connection_limit() == 512


# --- the end --------------------------------------------------------------------------------------------------------


@contextmanager
def explored():
    """The command as a process, its port, and all processes that it has started."""
    command = [sys.executable, "-m", "chuteflow", "explore", "--no-browser", "--port", "0"]
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    assert process.stdout is not None
    try:
        found = re.search(r":(\d+)/", process.stdout.readline())
        assert found
        assert process.stdout.readline().startswith("Its first answers come in ")
        yield process, int(found[1])
    finally:
        if process.poll() is None:
            process.kill()
        process.communicate()


def descendants(process, least):
    """The processes that it has started, once there are so many."""
    until = time.monotonic() + 20.0
    while True:
        found = psutil.Process(process.pid).children(recursive=True)
        if len(found) >= least or time.monotonic() > until:
            return found
        time.sleep(0.05)


def alive(processes):
    """Those that have not ended within two seconds; a zombie has ended."""
    until = time.monotonic() + 2.0
    while True:
        left = [one for one in processes if one.is_running() and one.status() != psutil.STATUS_ZOMBIE]
        if not left or time.monotonic() > until:
            return left
        time.sleep(0.05)


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
@pytest.mark.parametrize("name", ["SIGTERM", "SIGKILL", "SIGHUP"])
def test_workers_end_with_the_server(name):
    with explored() as (process, _):
        started = descendants(process, 4)
        assert len(started) >= 4
        process.send_signal(getattr(signal, name))
        process.wait(5)
        assert alive(started) == []


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
@pytest.mark.parametrize("interrupts", [1, 3])
def test_ctrl_c_ends_it_with_one_line_whatever_is_in_work(interrupts, half_sent):
    with explored() as (process, port), half_sent(port, 5), socket.create_connection(("127.0.0.1", port), 10) as asks:
        asks.sendall(
            b"GET /ask/stability?slope=0.3&e=0.8&ew=0.8&roughness=0.6&Q=3&flow=0 HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"
        )
        started = descendants(process, 5)
        began = time.monotonic()
        for _ in range(interrupts):
            os.killpg(process.pid, signal.SIGINT)  # as a terminal does, to all of them
            time.sleep(0.02)
        out, complaints = process.communicate(timeout=20)
        assert time.monotonic() - began < 4.0  # twice the target: other tests run beside this one
        assert (process.returncode, out, complaints) == (0, "The explorer has ended\n", "")
        assert alive(started) == []
