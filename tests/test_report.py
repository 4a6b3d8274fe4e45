"""The page of the report: what it says, how it is built, and how a browser shows it."""

import re
import shutil
import subprocess
from html.parser import HTMLParser
from io import StringIO
from math import nan, radians
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from validation import races, references, studies
from validation.checks import Check, Curve, Map, Maps, Note, Plot, Table, formula
from validation.documents import coverage
from validation.fmu import W02, Experiment, Fmu, SolverMethod, swing
from validation.metrics import state_error
from validation.references.methods import METHODS, linear_radius
from validation.report import cells, figures, page, screen
from validation.report.section import Section, summary
from validation.report.words import TASKS

VOID = {"meta", "br", "img", "link", "hr"}
BROWSERS = ("chromium", "chromium-browser", "google-chrome")


class Reader(HTMLParser):
    """Collects elements, and complains about ends without a beginning."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.ids: list[str] = []
        self.links: list[str] = []
        self.tags: list[str] = []
        self.pictures: list[str | None] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        named = dict(attrs)
        if named.get("id"):
            self.ids.append(str(named["id"]))
        if tag == "svg":
            self.pictures.append(named.get("aria-label") if named.get("role") == "img" else None)
        if tag == "a":
            self.links.append(str(named["href"]))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self.open.pop()

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


SECTIONS = [
    Section(
        "good",
        "A study: of good rows",
        "a < b & c",
        [
            Check("small", 1.5e-12, 2.5e-12, "theory", "s"),
            formula("a formula", 0.0, 1e-15, "digits"),
            Note("Accuracy: very good.", headline=True),
            Table("A long table", ("x", "y"), [(i, i / 7e7) for i in range(20)]),
            Plot(
                "A picture",
                "x",
                "y",
                [Curve("FMU", [1, 2], [3, 4])],
                note="What to see.",
                below=[Curve("error", [1, 2], [1e-3, 1e-4])],
                below_label="error",
                below_logarithmic="y",
            ),
            Maps(
                "Maps",
                "x",
                "y",
                [1.0, 2.0],
                [3.0, 4.0],
                [
                    Map(f"map {i}", [[nan, 1e-20], [0.1 * i, 2.0]], [[1.0, 2.0], [3.0, 1.0 + 0.1 * i]])
                    for i in range(5)
                ],
                "error",
                (1e-16, 1.0),
                "time",
                (1.0, 4.0),
                note="Crosses are lost.",
            ),
        ],
    ),
    Section("bad", "A study that fails", "x", [Check("no number", nan, 1.0, "theory")]),
]


@pytest.fixture(scope="module")
def text(fmu_path: Path) -> str:
    return page.render(SECTIONS, fmu_path, figures.svg)


@pytest.fixture(scope="module")
def reader(text: str) -> Reader:
    reader = Reader()
    reader.feed(text)
    reader.close()
    return reader


def test_every_element_is_closed_and_every_name_stands_once(reader: Reader) -> None:
    assert reader.open == []
    assert len(reader.ids) == len(set(reader.ids))


def test_no_study_takes_the_name_of_another_part() -> None:
    assert not {"top", "tasks", "margins", "glossary", "faults"} & set(studies.NAMES)


def test_links_of_the_contents_reach_their_place(reader: Reader) -> None:
    assert reader.links
    assert all(link.startswith("#") and link[1:] in reader.ids for link in reader.links)


def test_the_verdict_counts_each_kind_of_rows(text: str) -> None:
    assert "<b>1 of 2</b> rows about the FMU hold" in text
    assert "<b>1 of 1</b> rows about the documents and formulas hold" in text
    assert summary(SECTIONS[:1]) == (
        "1 of 1 rows about the FMU hold; 1 of 1 rows about the documents and formulas hold"
    )
    missed = Section("race", "A race", "x", [races.not_measured("time: of a run", 2.0, "no rival is there")])
    assert summary([missed]) == "0 of 1 rows about run times on this machine hold"


def test_failing_rows_come_first_and_open(text: str) -> None:
    assert (
        text.index("Failing rows")
        < text.index("<b>Accuracy: </b>very good.")
        < text.index("a &lt; b &amp; c")
    )
    bad = text[text.index('id="bad"') :]
    assert "<details open>" in bad
    assert "<details open>" not in text[text.index('id="good"') : text.index('id="bad"')]


def test_long_tables_are_folded_and_pictures_have_captions(text: str) -> None:
    assert re.search(r"<details><summary>A long table", text)
    assert "<figcaption>What to see.</figcaption>" in text
    assert "<figcaption>Crosses are lost.</figcaption>" in text


def test_every_picture_has_a_name_that_is_read_out(reader: Reader) -> None:
    assert sorted(map(str, reader.pictures)) == ["A picture", "Maps", "Margins of all rows by study"]


def test_a_page_needs_nothing_but_itself(text: str, reader: Reader) -> None:
    assert not {"script", "link", "img", "iframe"} & set(reader.tags)
    assert not re.search(r'(?:src|href)="https?://', re.sub(r'xmlns[^"]*"[^"]*"', "", text))


def test_a_page_is_the_same_the_second_time(text: str, fmu_path: Path) -> None:
    assert page.render(SECTIONS, fmu_path, figures.svg) == text


def test_numbers_do_not_break_at_their_exponent(text: str) -> None:
    assert '<td class="number"><span class="unbroken">1.42857e-08</span></td>' in text
    assert "td.number { white-space: nowrap" in text
    assert cells.is_number("1e-3")
    assert not cells.is_number("1 s")
    assert cells.unbroken("< 8e-14 s") == '&lt; <span class="unbroken">8e-14</span> s'
    assert '<td class="short"><span class="unbroken">1.5e-12</span> s</td>' in text
    assert re.search(r"\.unbroken { white-space: nowrap", text)


def test_numbers_are_whole_in_a_terminal_of_80_columns() -> None:
    name = "a claim with a name much longer than its column: error beyond that of RK4, from rest to rest"
    results = [
        Check(name, 4.62e-12, 7.56e-12, "theory", "rad"),
        Table("A table", ("motion", "h [s]", "error of the state [rad]"), [(name, 1e-3, 4.62345e-12)] * 2),
    ]
    to = Console(width=80, file=StringIO(), highlight=False)
    screen.show(Section("study", "A study", "x", results), to)
    assert isinstance(to.file, StringIO)
    shown = to.file.getvalue()
    assert "4.62e-12 rad" in shown
    assert "<= 7.56e-12" in shown
    assert shown.count("4.62345e-12") == 2
    assert max(map(len, shown.splitlines())) <= 80


def test_files_are_named_for_what_they_hold() -> None:
    assert page.slug("Relative errors of K(k), k = sin(alpha/2)") == "relative-errors-of-k-k-k-sin-alpha-2"


def test_every_formula_of_the_documents_has_its_study_or_a_reason() -> None:
    for _, where in (*coverage.CRAWFORD, *coverage.GRILLO):
        first = re.match(r"\w+", where)
        assert first
        assert first[0] in (*studies.NAMES, "none", "all")


def swing_error_of(fmu: Fmu, method: SolverMethod, angle: float, h: float, stop: float) -> float:
    """Return the largest error [rad] of the state of an undamped swing from `angle` [deg]."""
    run = fmu.run(Experiment(stop, 0.1, swing(radians(angle), h, method), record=("phi", "w")))
    return state_error(run["phi"], run["w"], references.libration(run.t, radians(angle), W02))


def test_what_the_tasks_promise_is_true(fmu_path: Path) -> None:
    expected = {method: what for _, method, what in TASKS}
    rk4, taylor = SolverMethod.ExplicitRungeKutta4, SolverMethod.TaylorSeries
    assert "1e-12 to 4e-12 rad a second with h = 1 ms, by 1e-8 to 4e-8 with 10 ms" in expected[rk4.name]
    assert "h = 0.1 s from 90 deg is right to 2e-13 rad for 20 s" in expected[taylor.name]
    with Fmu(fmu_path) as fmu:
        for angle in (30, 90, 150, 170):
            assert 1e-12 <= swing_error_of(fmu, rk4, angle, 1e-3, 1.0) <= 4e-12
            assert 1e-8 <= swing_error_of(fmu, rk4, angle, 1e-2, 1.0) <= 4e-8
        assert swing_error_of(fmu, taylor, 90, 0.1, 20.0) <= 2e-13


def test_rk4_is_stable_where_the_tasks_say_so() -> None:
    assert (
        "stable for h below 0.8 s and gamma/m*h below 2.7"
        in dict(row[1:] for row in TASKS)["ExplicitRungeKutta4"]
    )
    steps = np.geomspace(1e-3, 0.8, 40)
    radii = [
        linear_radius(METHODS["ExplicitRungeKutta4"], share / h, W02, h)
        for h in steps
        for share in np.linspace(0, 2.7, 60)
    ]
    assert max(radii) <= 1 + 1e-12  # without drag short steps shrink by less than a rounding


def in_browser(text: str, folder: Path, width: int, script: str) -> str:
    """Return what `script`, the body of a function of the page and its window, answers in a window `width` wide."""
    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    if browser is None:
        pytest.skip(f"no browser: {', '.join(BROWSERS)}")
    (folder / "report.html").write_text(text, "utf-8")
    # In a frame, because a window of Chromium is never narrower than 500 pixels.
    (folder / "frame.html").write_text(
        f"""<!DOCTYPE html><title></title>
        <script>async function answer(page, window) {{ {script} }}</script>
        <iframe style="width: {width}px; height: 800px; border: 0" src="report.html"
        onload="answer(this.contentDocument, this.contentWindow).then(found => document.title = found)"></iframe>""",
        "utf-8",
    )
    options = (
        *("--headless", "--no-sandbox", "--disable-gpu", "--window-size=1400,900"),
        *("--allow-file-access-from-files", "--virtual-time-budget=20000", "--dump-dom"),
    )
    done = subprocess.run(
        [browser, *options, (folder / "frame.html").as_uri()],
        capture_output=True,
        text=True,
        check=True,
    )
    title = re.search(r"<title>(.+)</title>", done.stdout)
    assert title
    return title[1]


WIDTHS = pytest.mark.parametrize("width", [1200, 400])


@WIDTHS
def test_nothing_is_wider_than_the_window(text: str, tmp_path: Path, width: int) -> None:
    assert int(in_browser(text, tmp_path, width, "return page.documentElement.scrollWidth")) <= width


@WIDTHS
def test_the_headings_that_the_contents_lead_to_are_in_view(text: str, tmp_path: Path, width: int) -> None:
    hidden = in_browser(
        text,
        tmp_path,
        width,
        """
        const hidden = [];
        for (const link of page.querySelectorAll("nav a")) {
            link.click();
            await new Promise(done => setTimeout(done, 100));
            const heading = page.querySelector(link.hash).querySelector("h1, h2").getBoundingClientRect();
            const nav = page.querySelector("nav").getBoundingClientRect();
            const above = nav.right > heading.left ? nav.bottom : 0;
            if (heading.top < above || heading.bottom > window.innerHeight) hidden.push(link.hash);
        }
        return hidden.length ? hidden.join(" ") : "none";
        """,
    )
    assert hidden == "none"
