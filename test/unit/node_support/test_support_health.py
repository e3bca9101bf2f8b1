"""What a stage reports of itself, and how often it warns."""

import threading

import pytest

from node_support.health import WARNING_PERIOD, Health, Level


class _Stage:
    """A health with a clock that is set by hand and a list of the warnings given."""

    def __init__(self):
        self.now = 100.0
        self.warnings = []
        self.health = Health("thresholder", self.warnings.append, lambda: self.now)

    def problems_at(self, *times, kind="beams refused"):
        for self.now in times:
            self.health.problem(kind, f"at {self.now:g}")


@pytest.fixture
def stage():
    return _Stage()


def test_the_first_problem_is_warned_of_at_once_and_more_of_its_kind_in_one_warning_that_says_how_many(stage):
    stage.problems_at(0.0, 1.0, 2.0, WARNING_PERIOD - 0.1, WARNING_PERIOD)
    first, second = "1 beams refused (1 in all): at 0", "4 beams refused (5 in all): at 10"
    assert stage.warnings == [f"thresholder: {first}", f"thresholder: {second}"]


def test_a_flood_is_warned_of_more_and_more_seldom_until_once_a_minute(stage):
    stage.problems_at(*[step * 0.25 for step in range(1000)])
    assert [line.rpartition("at ")[2] for line in stage.warnings] == ["0", "10", "30", "70", "130", "190"]


def test_after_a_pause_a_flood_is_warned_of_as_in_the_beginning(stage):
    stage.problems_at(*range(200), 400, 405, 410)
    assert [line.rpartition("at ")[2] for line in stage.warnings][-3:] == ["190", "400", "410"]


def test_kinds_are_throttled_one_by_one(stage):
    stage.problems_at(0.0, 1.0, kind="beams refused")
    stage.problems_at(1.0, 2.0, kind="clouds refused")
    told = "thresholder: 1 beams refused (1 in all): at 0", "thresholder: 1 clouds refused (1 in all): at 1"
    assert stage.warnings == list(told)


def test_problems_can_be_counted_by_the_number(stage):
    stage.health.problem("points outside the map", "beyond 10 m", 7)
    stage.health.problem("points outside the map", "beyond 10 m", 5)
    assert stage.health.report().values["points outside the map"] == "12"
    assert stage.warnings == ["thresholder: 7 points outside the map (7 in all): beyond 10 m"]


def test_recent_problems_of_all_kinds_show_in_level_and_text(stage):
    stage.problems_at(0.0, 1.0)
    stage.problems_at(1.0, kind="clouds refused")
    report = stage.health.report()
    assert (report.level, report.text) == (Level.WARN, "2 beams refused: at 1; 1 clouds refused: at 1")


def test_an_old_problem_shows_in_its_total_only(stage):
    stage.problems_at(0.0)
    stage.now = WARNING_PERIOD
    report = stage.health.report()
    assert (report.level, report.text) == (Level.OK, "running")
    assert report.values == {"beams refused": "1"}


def test_counters_are_totals_and_rates_those_since_the_previous_report(stage):
    for number, seconds, total, rate in [(10, 2.0, "10", "5.00"), (3, 4.0, "13", "0.75"), (0, 1.0, "13", "0.00")]:
        stage.health.count("beams in", number)
        stage.now += seconds
        values = stage.health.report().values
        assert (values["beams in"], values["beams in per second"]) == (total, rate)
    assert stage.health.report().values["beams in"] == "13"  # at the same moment


def test_values_are_reported_as_they_are_and_the_newest_wins(stage):
    stage.health.show("blocks", "10")
    stage.health.show("blocks", "12")
    assert stage.health.report().values == {"blocks": "12"}


def test_processing_times_also_of_failures_are_reported_in_milliseconds(stage, monkeypatch):
    ticks = iter([0.0, 0.001, 1.0, 1.003])
    monkeypatch.setattr("time.perf_counter", lambda: next(ticks))
    with stage.health.timed():
        pass
    with pytest.raises(ZeroDivisionError), stage.health.timed():
        raise ZeroDivisionError
    values = stage.health.report().values
    assert (values["processing time mean [ms]"], values["processing time longest [ms]"]) == ("2.000", "3.000")


def test_counts_from_many_threads_are_all_kept(stage):
    def work():
        for _ in range(2000):
            stage.health.count("beams in")
            stage.health.problem("beams refused", "again")

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    values = stage.health.report().values
    assert (values["beams in"], values["beams refused"]) == ("8000", "8000")


def test_a_warning_may_use_the_health_it_comes_from():
    health = Health("stage", lambda line: health.count("warnings"), lambda: 0.0)
    health.problem("beams refused", "once")
    assert health.report().values["warnings"] == "1"


def test_a_problem_that_somebody_waits_to_hear_of_is_warned_of_each_time(stage):
    for value in (1, 2):
        stage.health.answered_problem("changes of parameters refused", f"mean_k = -{value}")
    assert stage.warnings == [f"thresholder: changes of parameters refused: mean_k = -{value}" for value in (1, 2)]
    assert stage.health.report().values["changes of parameters refused"] == "2"


@pytest.mark.parametrize(
    ("came", "now", "expected", "seconds"),
    [
        ((0.0, 0.1, 0.2), 4.0, False, None),
        ((0.0, 0.1, 0.2), 6.2, False, 6),
        ((0.0, 14.0, 28.0), 50.0, False, None),
        ((0.0, 14.0, 28.0), 57.0, False, 29),
        ((), 60.0, False, None),
        ((), 6.0, True, 6),
        ((0.0, 0.1), 2.0, True, None),
    ],
)
def test_an_input_that_ceased_is_named_with_its_topic(stage, came, now, expected, seconds):
    stage.now = 0.0
    if expected:
        stage.health.expect("/heading")
    for stage.now in came:
        stage.health.heard("/heading")
    stage.now = now
    report = stage.health.report()
    told = (Level.OK, "running") if seconds is None else (Level.WARN, f"nothing on /heading for {seconds} s")
    assert (report.level, report.text) == told


def test_an_input_that_never_came_is_warned_of_each_time_that_the_silence_doubled(stage):
    stage.now = 0.0
    stage.health.expect("/heading")
    for stage.now in range(1, 40):
        stage.health.report()
    stage.health.heard("/heading")
    stage.now = 100.0
    stage.health.report()
    told = "thresholder: nothing came on /heading for {} s: does anybody publish it?"
    assert stage.warnings == [told.format(15), told.format(30)]
