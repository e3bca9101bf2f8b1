"""The report as one HTML page: figures, a slider over the scans, and the checks of the run with their lights."""

import base64
import json
from dataclasses import dataclass
from enum import Enum
from html import escape
from pathlib import Path
from string import Template
from typing import Dict, Iterable, List, Mapping, Sequence, Tuple

import numpy as np
from plotly.graph_objects import Figure
from plotly.offline import get_plotlyjs

from mlsm_manager.report.figures import (
    SCAN_TRACE,
    VEHICLE_TRACE,
    correction_over_time,
    map_from_above,
    map_in_3d,
    sensor_health,
)
from mlsm_manager.report.mission import Mission
from mlsm_manager.self_check.verdict import Answer, RunAnswer, Verdict
from node_support.files import package_folder, write_whole

_NEAR = 0.75  # share of a limit from which on a figure is worth a look
_MOST_POINTS = 800  # of a scan: more cannot be told apart on a screen
_UNIT = 0.01  # m: points are stored as whole centimetres from the vehicle
_FARTHEST = np.iinfo(np.int16).max * _UNIT
_SOLID = '<h2>Map in 3-D</h2>\n<div class="turning">%s</div>\n<img class="printed" alt="The map in 3-D">\n'


class Light(Enum):
    """How a check ended."""

    GREEN = "fine"
    AMBER = "near its limit"
    RED = "doubtful"
    GREY = "not measured"


@dataclass(frozen=True)
class _Quantity:
    """What a client reads of a calibrated quantity.

    factor: from its own unit to `unit`. more, less: what a positive and what a negative value means.
    """

    what: str
    factor: float
    unit: str
    digits: int
    more: str
    less: str

    def told(self, value: float) -> str:
        return f"{self.number(value)} {self.more if value >= 0.0 else self.less}"

    def number(self, value: float) -> str:
        return f"{abs(value) * self.factor:.{self.digits}f} {self.unit}"


_QUANTITIES = {
    "range_scale_error": _Quantity(
        "ranges of the sonar", 100.0, "%", 1, "longer than the sonar says", "shorter than the sonar says"
    ),
    "sonar_delay": _Quantity("beams", 1.0, "s", 2, "later than their stamps", "earlier than their stamps"),
    "odometry_scale": _Quantity(
        "distances of the odometry", 100.0, "%", 1, "longer than the odometry says", "shorter than the odometry says"
    ),
    "odometry_direction": _Quantity(
        "direction of motion", float(np.degrees(1.0)), "degrees", 1, "to the left of what the odometry says",
        "to the right of what the odometry says",
    ),
}  # fmt: skip
_CHECK_HEAD = ("", "question", "what was found", "")
_LIGHT_COLORS = {Light.GREEN: "#2e8540", Light.AMBER: "#e0a526", Light.RED: "#c0392b", Light.GREY: "#999999"}


def write_report(path: Path, mission: Mission) -> None:
    """Write the page whole or not at all; raises OSError."""
    write_whole(path, report_page(mission).encode("utf-8"))


def report_page(mission: Mission) -> str:
    """Return the page; it needs no other file and no network."""
    lights = [light_of(verdict) for verdict in mission.verdicts]
    rejected = [
        (f"{scan.time - mission.start:.0f}", escape(scan.rejection)) for scan in mission.scans if scan.rejection
    ]
    checks = [(_lamp(light), escape(verdict.question or verdict.name), escape(sentence(verdict)), light.value)
              for verdict, light in zip(mission.verdicts, lights)]  # fmt: skip
    page = Template((package_folder() / "web/templates/report.html").read_text(encoding="utf-8"))
    return page.substitute(
        title=escape(mission.title),
        plotly=get_plotlyjs(),
        summary=f"{_lamp(light_of_run(mission.answer, lights))} {escape(mission.headline)}",
        facts=_table(("", ""), _words(mission.facts)),
        checks=_table(_CHECK_HEAD, checks, "checks") if checks else "<p>No checks were made.</p>",
        errors=_errors(mission),
        above=_figure(map_from_above(mission), "above"),
        solid="" if mission.blocks.is_flat else _SOLID % _figure(map_in_3d(mission), "solid"),
        correction=_figure(correction_over_time(mission), "correction"),
        health=_figure(sensor_health(mission), "health"),
        calibration=_calibration(mission),
        rejected=_table(("time [s]", "why"), rejected) if rejected else "<p>No scan was rejected.</p>",
        parameters=_table(("parameter", "value"), _words(mission.parameters)),
        last_scan=len(mission.scans) - 1,
        scan_trace=SCAN_TRACE,
        vehicle_trace=VEHICLE_TRACE,
        scans=slider_json(mission),
    )


def _figure(figure: Figure, identity: str) -> str:
    config = {"displaylogo": False, "responsive": True}
    return figure.to_html(include_plotlyjs=False, full_html=False, div_id=identity, config=config)


def _lamp(light: Light) -> str:
    return f'<span class="lamp" style="background:{_LIGHT_COLORS[light]}" title="{light.value}"></span>'


def _errors(mission: Mission) -> str:
    if not mission.errors:
        return ""
    rows = [
        (escape(name.replace("_", " ")), *(f"{error[key]:.2f}" for key in ("mean", "sd", "max")))
        for name, error in mission.errors.items()
    ]
    return "<h2>Distance from the truth [m]</h2>" + _table(("path", "mean", "sd", "max"), rows)


def _calibration(mission: Mission) -> str:
    found = {_QUANTITIES[name]: told for name, told in mission.calibration.items()}
    rows = [
        (quantity.what, quantity.told(value), f"± {quantity.number(deviation)}")
        for quantity, (value, deviation) in found.items()
        if deviation > 0.0  # others are no unknowns of this run, as those of an odometry that nobody reports
    ]
    return _table(("", "in truth", "standard deviation"), rows) if rows else "<p>Nothing was calibrated.</p>"


def _words(values: Mapping[str, object]) -> List[Tuple[str, str]]:
    return [(escape(name), escape(str(value))) for name, value in values.items()]


def _table(head: Sequence[str], rows: Iterable[Sequence[str]], style: str = "") -> str:
    titles = "".join(f"<th>{escape(title)}</th>" for title in head)
    body = "".join("<tr>" + "".join(f"<td>{cell}</td>" for cell in row) + "</tr>" for row in rows)
    return f'<table class="{style}"><thead><tr>{titles}</tr></thead><tbody>{body}</tbody></table>'


def light_of(verdict: Verdict) -> Light:
    if verdict.answer is not Answer.FINE:
        return Light.RED if verdict.fires else Light.GREY
    worse = verdict.limit / verdict.value if verdict.more_is_better else verdict.value / verdict.limit
    return Light.AMBER if worse > _NEAR else Light.GREEN


def light_of_run(answer: RunAnswer, lights: List[Light]) -> Light:
    """Return the light of the whole run; where all checks are fine that of the worst of their `lights`."""
    if answer is not RunAnswer.FINE:
        return Light.RED if answer is RunAnswer.DOUBTFUL else Light.GREY
    return Light.AMBER if Light.AMBER in lights else Light.GREEN


def sentence(verdict: Verdict) -> str:
    text = verdict.line() if verdict.answer is Answer.NOT_MEASURED else verdict.text
    return f"{text[:1].upper()}{text[1:]}."


def slider_json(mission: Mission) -> str:
    """Return the JSON that the page's script reads: time, vehicle and points of each scan.

    Points are little-endian int16 x y in hundredths of a metre from the vehicle, in base64.
    """
    scans: List[Dict[str, object]] = []
    for scan in mission.scans:
        vehicle, step = mission.best.at(scan.time), max(1, -(-len(scan.points) // _MOST_POINTS))
        near = np.clip((scan.points[:, :2] - vehicle)[::step], -_FARTHEST, _FARTHEST)
        packed = np.round(near / _UNIT).astype("<i2").tobytes()
        scans.append(
            {
                "time": round(scan.time - mission.start, 1),
                "vehicle": [round(value, 2) for value in vehicle.tolist()],
                "echoes": len(scan.points),
                "rejection": scan.rejection,
                "points": base64.b64encode(packed).decode("ascii"),
            }
        )
    # A page may hold no "</" inside a script.
    return json.dumps({"unit": _UNIT, "scans": scans}).replace("</", "<\\/")
