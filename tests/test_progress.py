"""Progress of long computations: on a terminal, below a cell of a notebook, and nowhere else."""

import inspect
import io
import sys
from types import SimpleNamespace

import pytest

import chuteflow
from chuteflow import progress
from chuteflow.progress import ProgressLine, report_progress


class Terminal(io.StringIO):
    def isatty(self):
        return True


def opened(monkeypatch):
    """A terminal as standard error. A fixture would open it before pytest puts its own in the place."""
    stream = Terminal()
    monkeypatch.setattr(sys, "stderr", stream)
    return stream


@pytest.fixture
def shown(monkeypatch):
    """What a notebook shows below its cell."""
    texts = []

    def display(content, raw, display_id):
        texts.append(content["text/plain"])
        return SimpleNamespace(update=lambda content, raw: texts.append(content["text/plain"]))

    shell = SimpleNamespace(kernel=object())
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda: shell))
    monkeypatch.setitem(sys.modules, "IPython.display", SimpleNamespace(display=display))
    return texts


def study():
    return chuteflow.scan(chuteflow.Chute(0.3, 0.8, 0.8, 0.6), Q=[1.0, 2.0])


def test_a_terminal_shows_a_line_and_loses_it_again(monkeypatch):
    terminal = opened(monkeypatch)
    monkeypatch.setattr(progress, "_SECONDS", 0.0)
    study()
    assert terminal.getvalue() == "\r\x1b[Kscan: 100%\r\x1b[K"


def test_a_notebook_shows_the_same_line_again_and_again(shown, monkeypatch):
    monkeypatch.setattr(progress, "_SECONDS", 0.0)
    study()
    assert shown == ["scan: 100%", ""]


def test_what_is_quick_shows_nothing(shown):
    with ProgressLine(3600.0) as line:
        line.show("much")
    assert shown == []


def test_nothing_is_shown_elsewhere(capsys, monkeypatch):
    monkeypatch.setattr(progress, "_SECONDS", 0.0)
    study()
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda: None))
    study()
    # At a prompt of IPython that is no notebook, the terminal counts.
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda: SimpleNamespace()))
    study()
    assert capsys.readouterr() == ("", "")


def test_a_worker_and_what_is_quiet_show_nothing(monkeypatch):
    terminal = opened(monkeypatch)
    with ProgressLine(quiet=True) as line:
        line.show("much")
    monkeypatch.setitem(sys.modules, "multiprocessing.process", SimpleNamespace(parent_process=lambda: object()))
    with ProgressLine() as line:
        line.show("much")
    assert terminal.getvalue() == ""


@pytest.mark.parametrize("stream", [None, io.BytesIO()])
def test_a_stream_that_is_none_is_no_terminal(stream, monkeypatch):
    monkeypatch.setattr(sys, "stderr", stream)
    assert not ProgressLine().is_shown


def test_a_function_that_is_given_is_called_instead(monkeypatch):
    terminal = opened(monkeypatch)
    fractions = []
    with report_progress("scan", fractions.append) as tell:
        tell(0.5)
    assert fractions == [0.5]
    assert terminal.getvalue() == ""


@pytest.mark.parametrize("name", ["scan", "sweep", "domain", "boundary", "growth", "neutral", "relax", "fit"])
def test_every_long_function_tells_its_progress(name):
    function = getattr(chuteflow, name)
    assert inspect.signature(function).parameters["progress"].default is None
    assert "a terminal or notebook shows" in " ".join(str(inspect.getdoc(function)).split())
