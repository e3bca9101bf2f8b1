"""Files that are generated from the parameter dataclasses agree with them."""

import importlib

import pytest
import yaml
from document import LIVE_NODES, generated
from programs import ROOT

from node_support.node_table import NODES
from node_support.parameters import config_name, describe


def test_generated_files_are_up_to_date():
    assert [path.name for path, text in generated().items() if path.read_text() != text] == []


@pytest.mark.parametrize("name", NODES)
def test_every_described_topic_stands_in_the_source(name):
    source = "\n".join(path.read_text() for path in (ROOT / "src").rglob("*.py"))
    names = [one.name.lstrip("~/") for one in NODES[name].interfaces]
    assert [topic for topic in names if topic.rpartition("/")[2] not in source] == []


@pytest.mark.parametrize("name", LIVE_NODES)
def test_the_default_yaml_makes_the_defaults(name):
    parameters = LIVE_NODES[name]
    text = (ROOT / "yaml" / f"{name}_default.yaml").read_text()
    assert parameters.from_mapping(yaml.safe_load(text)) == parameters()


@pytest.fixture(params=sorted(LIVE_NODES))
def live(request):
    """Return a parameter dataclass and the dynamic_reconfigure module that the build made of it."""
    module = f"underwater_map_construction.cfg.{config_name(request.param)}Config"
    return LIVE_NODES[request.param], importlib.import_module(module)


def test_dynamic_reconfigure_offers_the_tunable_fields(live):
    parameters, module = live
    assert list(module.defaults) == [field.name for field in parameters.tunable_fields()]


def test_dynamic_reconfigure_starts_from_the_defaults(live):
    parameters, module = live
    assert module.defaults.items() <= parameters().to_mapping().items()


def test_dynamic_reconfigure_has_the_ranges_of_numbers(live):
    parameters, module = live
    numbers = [field for field in parameters.tunable_fields() if field.type in (int, float)]
    expected = {field.name: (describe(field).low, describe(field).high) for field in numbers}
    assert {name: (module.min[name], module.max[name]) for name in expected} == expected
