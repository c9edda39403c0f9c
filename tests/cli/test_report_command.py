"""``chuteflow report``: one page that needs nothing else, whole or not there, and what it holds."""

import re
from dataclasses import replace
from datetime import UTC, datetime
from html.parser import HTMLParser

import pytest

from chuteflow import __version__
from chuteflow.cli.program import main
from chuteflow.paper.captions import CAPTIONS
from chuteflow.paper.claims import CLAIMS, check
from chuteflow.paper.figures import FIGURES
from chuteflow.paper.report import Report, page, versions

FEW = ("transition-angle", "flow-c", "lambda-of-figure-12")


class Page(HTMLParser):
    """The elements of a page: tags with their attributes, and the text."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.words: list[str] = []
        self.open: list[str] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))
        if tag not in ("meta", "img", "input"):
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.words.append(data)

    def all(self, tag: str) -> list[dict[str, str | None]]:
        """The attributes of every element of a tag."""
        return [attributes for name, attributes in self.elements if name == tag]

    @property
    def text(self) -> str:
        """All words, with single spaces."""
        return " ".join(" ".join(self.words).split())


@pytest.fixture
def few_claims():
    """The table with few claims, quick ones; afterwards all of them, in their order."""
    every = dict(CLAIMS)
    for id in set(CLAIMS) - set(FEW):
        del CLAIMS[id]
    yield
    CLAIMS.clear()
    CLAIMS.update(every)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """A report on two figures and no claims, and its text."""
    folder = tmp_path_factory.mktemp("report") / "new" / "folder"
    assert main(["report", "--only", "2,11", "--no-claims", "--out", str(folder)]) == 0
    return folder, (folder / "index.html").read_text(encoding="utf-8")


# The page


def test_it_is_one_file(written):
    folder, _ = written
    assert [path.name for path in folder.iterdir()] == ["index.html"]


def test_it_asks_for_nothing(written):
    _, text = written
    found = Page(text)
    assert found.open == []
    for _, attributes in found.elements:
        for name in ("src", "href", "data", "srcset", "action", "poster"):
            value = attributes.get(name)
            assert value is None or value.startswith(("#", "data:image/svg+xml;base64,"))
    assert not found.all("script")
    assert not found.all("link")
    assert not found.all("iframe")
    assert "@import" not in text
    assert "url(" not in text
    (policy,) = [m["content"] for m in found.all("meta") if m.get("http-equiv") == "Content-Security-Policy"]
    assert policy is not None
    assert policy.startswith("default-src 'none'")
    assert "http" not in policy


def test_it_holds_the_figures_with_captions_and_numbers(written):
    _, text = written
    found = Page(text)
    images = found.all("img")
    assert [str(image["alt"]).split(":")[0] for image in images] == ["Figure 2", "Figure 11"]
    for number in (2, 11):
        assert f"Figure {number}. {FIGURES[number]}" in found.text
        assert " ".join(CAPTIONS[number].split()) in found.text
    for number in ("7.33857", "3.98374", "1.7709"):  # T of A, h of B and C
        assert number in found.text
    assert "slope = 0.3" in found.text
    assert "figure-4" not in text


def test_it_says_what_made_it(written):
    _, text = written
    found = Page(text)
    assert versions()["chuteflow"] == __version__
    for name, version in versions().items():
        assert f"{name} {version}" in found.text
    assert re.search(r"date \d{4}-\d\d-\d\d \d\d:\d\d:\d\d", found.text)
    assert re.search(r"time taken [\d.]+ s", found.text)
    assert "relative error of Q, h and M up to 1e-10" in found.text


def test_every_place_that_is_linked_is_there(written):
    found = Page(written[1])
    ids = {attributes.get("id") for _, attributes in found.elements}
    assert {str(a["href"]).removeprefix("#") for a in found.all("a")} <= ids


def test_it_holds_the_claims_with_their_verdicts(few_claims, tmp_path, capsys):
    assert main(["report", "--only", "11", "--out", str(tmp_path)]) == 0
    found = Page((tmp_path / "index.html").read_text(encoding="utf-8"))
    rows = [row.get("class") for row in found.all("tr") if row.get("class")]
    assert rows == [verdict.verdict for verdict in check()]
    assert "2 confirmed" in found.text
    assert "1 corrected" in found.text
    for verdict in check():
        for words in (verdict.id, verdict.statement, verdict.source, verdict.reason):
            assert words in found.text
    captured = capsys.readouterr()
    said = re.escape(f"{tmp_path / 'index.html'}: 1 figures, 3 claims, ")
    assert re.fullmatch(said + r"\d+ s\n", captured.out)
    progress = captured.err.splitlines()
    assert re.fullmatch(r"figure 11 of 17: [\d.]+ s", progress[0])
    assert progress[1:] == [f"claim {i} of 3, {v.id}: {v.verdict}" for i, v in enumerate(check(), 1)]


def test_words_cannot_become_markup():
    (verdict,) = check(["flow-a"])
    sly = replace(verdict, statement='<b title="x">a < b & c</b>', reason="</td><script>")
    text = page(Report([], [sly], "a <method>", datetime.now(UTC), 1.0))
    found = Page(text)
    assert found.open == []
    assert not found.all("script")
    assert not found.all("b")
    assert "a < b & c" in found.text
    assert "a <method>" in found.text


# Whole or not there


def test_a_failure_leaves_the_old_page_as_it_was(few_claims, tmp_path, monkeypatch):
    (tmp_path / "index.html").write_text("old", encoding="utf-8")

    def broken():
        raise OSError(28, "No space left on device")

    monkeypatch.setitem(CLAIMS, "flow-c", replace(CLAIMS["flow-c"], test=broken))
    assert main(["report", "--only", "11", "--out", str(tmp_path)]) != 0
    assert (tmp_path / "index.html").read_text(encoding="utf-8") == "old"
    assert [path.name for path in tmp_path.iterdir()] == ["index.html"]


def test_a_second_run_takes_nothing_of_the_first(tmp_path):
    for method in ("overburden", "mapped"):
        assert main(["report", "--only", "2", "--no-claims", "--method", method, "--out", str(tmp_path)]) == 0
        text = Page((tmp_path / "index.html").read_text(encoding="utf-8")).text
        assert f"Flows by the method {method}:" in text
        assert f"method: {method}:" in text


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--only", "2,99"], "there is no figure 99 here: choose from "),
        (["--out", "file/folder"], "cannot make the directory file/folder"),
        (["--out", "taken"], "it is not a regular file"),
        (["--only", "2", "--only", "3"], "is given 2 times"),
        (["extra"], "extra"),
    ],
)
def test_a_mistake_is_one_line_and_2_and_writes_nothing(arguments, message, tmp_path, monkeypatch, refused):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").touch()
    (tmp_path / "taken" / "index.html").mkdir(parents=True)
    refused(["report", *arguments], message)
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["file", "index.html", "taken"]


# In a browser


@pytest.fixture
def browser():
    import shutil

    found = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if found is None:
        pytest.skip("no chromium here")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=found, args=["--no-sandbox", "--disable-gpu", "--disable-background-networking"]
        )
        yield browser
        browser.close()


def test_a_browser_shows_it_and_asks_nobody(few_claims, browser, tmp_path):
    assert main(["report", "--only", "2,14", "--out", str(tmp_path)]) == 0
    for width in (1300, 420):
        tab = browser.new_page(viewport={"width": width, "height": 900})
        asked: list[str] = []
        troubles: list[str] = []
        tab.on("request", lambda request, asked=asked: asked.append(request.url))
        tab.on("console", lambda message, troubles=troubles: troubles.append(message.text))
        tab.on("pageerror", lambda error, troubles=troubles: troubles.append(str(error)))
        tab.goto((tmp_path / "index.html").as_uri())
        assert troubles == []
        assert {url.split(":")[0] for url in asked} <= {"file", "data"}
        assert tab.evaluate("[...document.images].map(i => i.naturalWidth > 0)") == [True, True]
        assert tab.evaluate("document.documentElement.scrollWidth") <= width
        rows = tab.locator("#claims tbody tr")
        assert [rows.nth(i).is_visible() for i in range(3)] == [True, True, True]
        tab.locator("label[for=show-corrected]").click()
        shown = [rows.nth(i).get_attribute("class") for i in range(3) if rows.nth(i).is_visible()]
        assert shown == ["corrected"]
        tab.close()
