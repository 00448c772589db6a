"""What nodes are run with."""

from pathlib import Path
from xml.etree import ElementTree

import pytest

pytestmark = pytest.mark.ros

from texture_core.ros.run import PROFILES, prefer_our_profile  # noqa: E402


def test_nodes_have_a_profile_in_which_a_killed_one_is_found_again_soon() -> None:
    environment: dict[str, str] = {}
    prefer_our_profile(environment)
    profile = ElementTree.parse(Path(environment[PROFILES])).getroot()

    def seconds(name: str) -> float:
        period = profile.find(f'.//{{*}}{name}')
        return float(period.findtext('{*}sec')) + float(period.findtext('{*}nanosec')) / 1e9

    assert (seconds('leaseAnnouncement'), seconds('heartbeatPeriod')) == (0.5, 0.2)
    assert profile.find('.//{*}leaseDuration') is None  # a short one loses nodes that live
    assert [locator[0].tag.rpartition('}')[2] for locator in profile.iterfind('.//{*}locator')] == ['udpv4']


def test_the_users_profile_is_kept() -> None:
    environment = {PROFILES: '/mine.xml'}
    prefer_our_profile(environment)
    assert environment == {PROFILES: '/mine.xml'}
