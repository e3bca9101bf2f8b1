"""When a stage that removes everything is noticed."""

from sonar_processing.filters.stage_table import EmptiedScans


def _noticed(scans):
    emptied = EmptiedScans()
    return [emptied.take(points_in, points_out) for points_in, points_out in scans]


def test_the_tenth_scan_in_a_row_without_a_point_is_noticed():
    assert _noticed([(5, 0)] * 10) == [None] * 9 + [10]


def test_it_is_noticed_again_at_every_tenth():
    assert [count for count in _noticed([(5, 0)] * 35) if count] == [10, 20, 30]


def test_one_point_that_passes_begins_the_count_anew():
    assert not any(_noticed([(5, 0)] * 9 + [(5, 1)] + [(5, 0)] * 9))


def test_scans_that_come_without_points_are_not_counted():
    assert _noticed([(5, 0)] * 9 + [(0, 0)] * 5 + [(5, 0)])[-1] == 10
