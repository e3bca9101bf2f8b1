import pytest
from ping360_fault_experiment import run

from ping360_driver.emulated_ping360 import EmulatorParameters
from ping360_driver.protocol.scan_command import ScanMode
from sonar_driver.emulator.faults import Fault

pytestmark = pytest.mark.newest_only("10,000 replies; the other tests send single ones with every version")


@pytest.fixture(scope="module", params=ScanMode, ids=[mode.value for mode in ScanMode])
def account(request):
    """Return what became of 10,000 replies of which a third met a fault."""
    return run(request.param, commands=10000, rate=1.0 / 24.0, seed=3)


def test_the_experiment_met_every_fault(account):
    assert set(account.faults) == {Fault.NONE, *EmulatorParameters.known()}


def test_with_every_fault_each_good_reply_is_delivered_once_and_in_order(account):
    assert account.delivered == sorted(set(account.delivered))
    assert [number for number in account.delivered if number not in account.optional] == account.expected


def test_with_every_fault_each_bad_reply_is_counted(account):
    """While the head scans by itself, a few pieces of broken messages in a row look like one message."""
    faults, stats = account.faults, account.stats
    spoilt = faults[Fault.GARBLED] + faults[Fault.TRUNCATED]
    assert spoilt >= stats.bad_frames >= (spoilt if stats.mode == "request" else 0.98 * spoilt)
    assert stats.unexpected_replies >= faults[Fault.DOUBLED]
    assert stats.refusals == faults[Fault.REFUSED]
    assert stats.pings == stats.replies + stats.timeouts + stats.bad_frames + stats.refusals + stats.interrupted
