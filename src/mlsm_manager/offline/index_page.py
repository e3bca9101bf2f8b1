"""What became of many recordings, and the page that shows it: a row with picture, trust and reasons for each."""

import html
from collections import Counter
from pathlib import Path
from string import Template
from typing import Any, Dict, List, NamedTuple, Sequence

from mlsm_manager.offline.run_files import PICTURE, REPORT
from mlsm_manager.self_check.verdict import RunAnswer
from node_support.errors import counted
from node_support.files import package_folder

_NO_MAP = "no map"
_COLORS = {
    RunAnswer.FINE.value: "#2e7d32",
    RunAnswer.PARTLY.value: "#5c6bc0",
    RunAnswer.UNMEASURED.value: "#757575",
    RunAnswer.DOUBTFUL.value: "#c77700",
    _NO_MAP: "#b3261e",
}


class Outcome(NamedTuple):
    """What became of a recording: the folder of its map, its summary, empty where there is no map, and why that is."""

    recording: Path
    folder: Path
    summary: Dict[str, Any]
    problem: str

    @property
    def answer(self) -> str:
        """How it came out, in words."""
        return self.summary.get("answer", RunAnswer.UNMEASURED.value) if self.summary else _NO_MAP


def index_page(outcomes: Sequence[Outcome], total: int) -> str:
    """Return the page of those of `total` recordings that are done."""
    found = Counter(outcome.answer for outcome in outcomes)
    counts = " &nbsp; ".join(f"{found[one]} {_badge(one)}" for one in _COLORS if found[one])
    title = f"{sum(bool(one.summary) for one in outcomes)} of {total} recordings mapped"
    waiting = f" &nbsp; {total - len(outcomes)} waiting" if len(outcomes) < total else ""
    page = Template((package_folder() / "web/templates/index.html").read_text(encoding="utf-8"))
    return page.substitute(title=title, counts=counts + waiting, rows="".join(map(_row, outcomes)))


def _badge(answer: str) -> str:
    return f'<b style="background:{_COLORS[answer]}">{answer}</b>'


def _row(outcome: Outcome) -> str:
    folder, own = outcome.folder, outcome.summary
    link, picture = html.escape(folder.name), ""
    if own:
        page = REPORT if (folder / REPORT).is_file() else ""
        shown = f'<img loading="lazy" alt="map of {link}" src="{link}/{PICTURE}">'
        picture = f'<a href="{link}/{page}">{shown}</a><small><a href="{link}/">files</a></small>'
    name, place = html.escape(outcome.recording.name), html.escape(str(outcome.recording.parent))
    told = "".join(f"<p>{html.escape(line)}</p>" for line in _lines(outcome))
    return f"<tr><td>{picture}</td><td><p>{_badge(outcome.answer)} {name}</p>{told}<small>{place}</small></td></tr>\n"


def _lines(outcome: Outcome) -> List[str]:
    own = outcome.summary
    if not own:
        return [outcome.problem]
    made = f"{counted(own['scans'], 'scan')}, {own['matched']} matched, {counted(own['blocks'], 'block')}"
    figures = f"{made}, {own['seconds']:.0f} s of work"
    odometry = f"odometry: {own['odometry']['profile']}, because {own['odometry']['reason']}"
    return [own.get("trust", ""), odometry, figures]
