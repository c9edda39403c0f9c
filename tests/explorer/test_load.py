"""The explorer under load: many clients, some of whom ask for chutes that cost too much, and unfinished requests."""

import http.client
import json
import random
import statistics
import threading
import time
from contextlib import ExitStack
from urllib.parse import urlencode, urlsplit

import pytest

SECONDS, CLIENTS, EXTREME = 60.0, 50, 10
#: The ordinary clients together ask for so much of the time of one processor.
SHARE = 0.3


class Client(threading.Thread):
    """Asks one question after another from an address of its own, and notes statuses and times."""

    def __init__(self, port, number, until, pause=1.0, extreme=False):
        super().__init__()
        self.port, self.until, self.pause, self.extreme = port, until, pause, extreme
        self.address = f"127.0.1.{number}"
        self.random = random.Random(number)
        self.times, self.answers = [], []

    def query(self):
        chute = {"e": 0.8, "ew": 0.8}
        if self.extreme:  # just below lambda = 3
            return chute | {"slope": f"{self.random.uniform(0.3735, 0.3742):.6f}", "roughness": 0.55, "Q": 3}
        slope, flux = self.random.uniform(0.28, 0.32), self.random.uniform(2.0, 6.0)
        return chute | {"slope": f"{slope:.6f}", "roughness": 0.6, "Q": f"{flux:.6f}"}

    def run(self):
        time.sleep(self.random.uniform(0.0, self.pause))
        while time.monotonic() < self.until:
            began = time.monotonic()
            connection = http.client.HTTPConnection(
                "127.0.0.1", self.port, timeout=60, source_address=(self.address, 0)
            )
            try:
                connection.request("GET", f"/ask/flows?{urlencode(self.query())}")
                response = connection.getresponse()
                self.answers.append((response.status, json.loads(response.read())))
            finally:
                connection.close()
            self.times.append(time.monotonic() - began)
            if not self.extreme:
                time.sleep(self.random.uniform(0.5, 1.5) * self.pause)


def ran(clients):
    for one in clients:
        one.start()
    for one in clients:
        one.join()
    return clients


@pytest.mark.slow
def test_fifty_clients_with_extreme_chutes_among_them_and_four_hundred_half_sent_requests(served, half_sent):
    with served() as page, ExitStack() as opened:
        port = urlsplit(page).port
        alone = ran([Client(port, 200, time.monotonic() + SECONDS / 3)])[0]
        assert {status for status, _ in alone.answers} == {200}
        opened.enter_context(half_sent(port, 400, "127.0.0.9"))
        until = time.monotonic() + SECONDS
        pause = (CLIENTS - EXTREME) * statistics.median(alone.times) / SHARE
        clients = ran([Client(port, i, until, pause, extreme=i < EXTREME) for i in range(CLIENTS)])
        statuses = {status for one in clients for status, _ in one.answers}
        ordinary = [one for one in clients if not one.extreme]
        assert {status for one in ordinary for status, _ in one.answers} == {200}
        # Extreme chutes are answered, or refused with what is left out; nobody floods, so that nobody is sent away.
        assert statuses <= {200, 422}
        times = [t for one in ordinary for t in one.times]
        ratio = statistics.median(times) / statistics.median(alone.times)
        extreme = sum(len(one.times) for one in clients) - len(times)
        told = f"{len(times)} ordinary questions and {extreme} extreme ones: "
        told += f"median {statistics.median(times):.3f} s, {ratio:.2f} times that of one client alone"
        print(told)
        assert ratio < 2.0, told
