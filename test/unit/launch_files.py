"""What launch files would set, without a master."""

from programs import ROOT
from roslaunch.config import load_config_default


def launched(name, *arguments):
    """Return the parameters that a launch file sets, by their full names."""
    config = load_config_default([(str(ROOT / "launch" / name), list(arguments))], port=None, verbose=False)
    return {key: one.value for key, one in config.params.items()}
