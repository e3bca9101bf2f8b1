"""When a stage that removes everything is noticed."""

from sonar_processing.filters.stage_table import EmptiedScans


def _noticed(scans):
    """Return the numbers of the scans, from 1 on, at which a stage is noticed."""
    emptied = EmptiedScans()
    return [number for number, (before, after) in enumerate(scans, 1) if emptied.take(before, after)]


def test_every_tenth_scan_in_a_row_without_a_point_is_noticed():
    assert _noticed([(5, 0)] * 35) == [10, 20, 30]


def test_one_point_that_passes_begins_the_count_anew():
    assert not _noticed([(5, 0)] * 9 + [(5, 1)] + [(5, 0)] * 9)


def test_scans_that_come_without_points_are_not_counted():
    assert _noticed([(5, 0)] * 9 + [(0, 0)] * 5 + [(5, 0), (0, 0)]) == [15]
