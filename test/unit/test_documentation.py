"""The documentation names only files, folders, headings and messages that exist."""

import re

import pytest
from benchmarks.__main__ import BENCHES, function_of
from programs import ROOT

DOCS = sorted((ROOT / "docs").glob("*.md"))
PAGES = [ROOT / "README.md", ROOT / "migration" / "README.md", *DOCS]
CODE_BLOCK = re.compile(r"^(?: {4}[^\n]*|```.*?^```)$", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"\]\(([^)\s]+)\)")
HEADING = re.compile(r"^#+ (.+)$", re.MULTILINE)
TABLE = re.compile(r"(?:^\|.*\n?)+", re.MULTILINE)
MOST_README_LINES = 170


def _paths_in(text):
    """Return what looks like a path from the top of the repository; placeholders such as <node> are left out."""
    folders = "|".join(sorted(path.name for path in ROOT.iterdir() if path.is_dir() and path.name != "build"))
    found = re.findall(rf"(?<![\w/.:$)~-])((?:{folders})/[\w./*-]*)(?![\w<])", text)
    return {path.rstrip("./") for path in found}


def _anchors(text):
    """Return the anchors that GitHub makes of the headings."""
    headings = [re.sub(r"[^\w\- ]", "", heading.lower()) for heading in HEADING.findall(CODE_BLOCK.sub("", text))]
    return {heading.replace(" ", "-") for heading in headings}


@pytest.fixture(params=PAGES, ids=lambda path: path.relative_to(ROOT).as_posix())
def page(request):
    """Return the path of a page."""
    return request.param


def test_every_path_that_a_page_names_exists(page):
    assert [path for path in _paths_in(page.read_text()) if not list(ROOT.glob(path))] == []


def test_every_link_of_a_page_leads_somewhere(page):
    links = [link for link in LINK.findall(CODE_BLOCK.sub("", page.read_text())) if not link.startswith("http")]
    assert [link for link in links if not _leads_somewhere(page, link)] == []


def _leads_somewhere(page, link):
    file, _, anchor = link.partition("#")
    target = (page.parent / file).resolve() if file else page
    return target.exists() and (not anchor or anchor in _anchors(target.read_text()))


def test_the_readme_links_to_every_page():
    linked = set(LINK.findall((ROOT / "README.md").read_text()))
    assert {path.relative_to(ROOT).as_posix() for path in DOCS} - linked == set()


def test_the_readme_stays_short():
    assert len((ROOT / "README.md").read_text().splitlines()) <= MOST_README_LINES


def test_every_picture_is_shown():
    shown = {(path.parent / link).resolve() for path in PAGES for link in LINK.findall(path.read_text())}
    assert set((ROOT / "docs" / "pictures").rglob("*.png")) - shown == set()


@pytest.mark.parametrize(
    "folder",
    sorted(
        path.parent.relative_to(ROOT).as_posix()
        for path in (ROOT / "src").glob("*/**/__init__.py")
        if path.parent.parent != ROOT / "src"
    ),
)
def test_the_architecture_page_describes_every_folder(folder):
    package, name = folder.split("/")[1], folder.split("/")[-1]
    tree = (ROOT / "docs" / "architecture.md").read_text().partition(f"src/{package}/")[2].partition("\n\n")[0]
    assert f"{name}/ " in tree


def test_the_architecture_page_names_only_what_stands_in_the_code():
    files = [path for folder in ("src", "scripts", "test") for path in (ROOT / folder).rglob("*.py")]
    code = "\n".join(path.read_text() for path in files)
    # Words with a capital letter, and functions such as beam_from_message; the others are topics, parameters and tools.
    page = (ROOT / "docs" / "architecture.md").read_text()
    names = re.findall(r"`([A-Z]\w+)(?:\.(?!txt)\w+)?`", page) + re.findall(r"`(\w+_from_\w+)`", page)
    assert [name for name in names if not re.search(rf"\b{name}\b", code)] == []


def test_every_message_that_a_page_explains_stands_in_the_code(page):
    code = "\n".join(path.read_text() for path in (ROOT / "src").rglob("*.py"))
    parts = [part for message in _explained_messages(page.read_text()) for part in message]
    assert [part for part in parts if part.strip() not in code] == []


def test_every_table_of_figures_names_the_command_that_prints_it(page):
    head, *sections = re.split(r"^(?=#+ )", page.read_text(), flags=re.MULTILINE)[1:]
    told = [section for section in (head, *sections) if any(map(_holds_figures, TABLE.findall(section)))]
    named = re.compile(r"scripts/(?:bench|results|soak)\b")
    assert [one.partition("\n")[0] for one in told if not named.search(one) and not named.search(head)] == []


def test_every_benchmark_that_a_page_names_exists(page):
    named = re.findall(r"scripts/bench (?:--)?([a-z][\w-]*)", page.read_text())
    assert {name.replace("-", "_") for name in named} <= set(BENCHES)


def test_every_benchmark_can_be_imported():
    assert all(map(callable, map(function_of, BENCHES)))


def _holds_figures(table):
    """Return whether most cells of a table, without heading and first column, begin with a number."""
    cells = [cell.strip() for row in table.splitlines()[2:] for cell in row.strip("| ").split("|")[1:]]
    return 2 * sum(1 for cell in cells if re.match(r"[-+<>]?\d", cell)) > len(cells)


def _explained_messages(text):
    """Return the parts, around "...", of the messages in the first column of tables that explain messages."""
    tables = re.findall(
        r"^\| (?:message|warning|value|status|you see) \|.*?(?=^[^|]|\Z)", text, re.MULTILINE | re.DOTALL
    )
    cells = [row.split(" | ")[0] for table in tables for row in table.splitlines()[2:]]
    return [message.split("...") for cell in cells for message in re.findall(r"[`\"]([^`\"]+)[`\"]", cell)]
