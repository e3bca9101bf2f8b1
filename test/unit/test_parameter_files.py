"""Files that are generated from the parameter dataclasses agree with them."""

import importlib
from pathlib import Path

import pytest

import yaml
from imagenex_852_driver.driver_parameters import DriverParameters
from imagenex_852_driver.emulator_parameters import EmulatorParameters
from mlsm_manager.core_parameters import MlsmCoreParameters
from node_support.parameter_text import default_yaml
from node_support.parameters import describe
from sonar_processing.outliers import OutlierRemoverParameters
from sonar_processing.scan_assembler import SonarToCloudParameters
from sonar_processing.stages import STAGES
from sonar_processing.threshold import ThresholderParameters
from sonar_simulator.default_yaml import gazebo_sonar_yaml, simulator_yaml

ROOT = Path(__file__).resolve().parents[2]
NODES = {
    "imagenex_852_driver": (DriverParameters, "Imagenex852"),
    "imagenex_852_emulator": (EmulatorParameters, "Imagenex852Emulator"),
    "mlsm_core": (MlsmCoreParameters, "MlsmCore"),
    "outlier_remover": (OutlierRemoverParameters, "OutlierRemover"),
    "sonar_to_cloud": (SonarToCloudParameters, "SonarToCloud"),
    "thresholder": (ThresholderParameters, "Thresholder"),
}


def _default_file(node):
    return (ROOT / "yaml" / f"{node}_default.yaml").read_text()


@pytest.mark.parametrize("node", NODES)
def test_the_default_yaml_says_what_the_dataclass_says(node):
    assert _default_file(node) == default_yaml(node, NODES[node][0])


@pytest.mark.parametrize("node", NODES)
def test_the_default_yaml_makes_the_defaults(node):
    assert NODES[node][0].from_mapping(yaml.safe_load(_default_file(node))) == NODES[node][0]()


def test_the_simulators_default_yaml_says_what_its_dataclasses_say():
    assert _default_file("sonar_simulator") == simulator_yaml()


def test_the_default_yaml_of_gazebo_sonar_says_what_its_dataclasses_say():
    assert _default_file("gazebo_sonar") == gazebo_sonar_yaml()


@pytest.fixture(params=sorted(NODES))
def generated(request):
    """Return a parameter dataclass and the dynamic_reconfigure module that the build made of it."""
    parameters, name = NODES[request.param]
    return parameters, importlib.import_module(f"underwater_map_construction.cfg.{name}Config")


def test_dynamic_reconfigure_offers_the_tunable_fields(generated):
    parameters, module = generated
    assert list(module.defaults) == [field.name for field in parameters.tunable_fields()]


def test_dynamic_reconfigure_starts_from_the_defaults(generated):
    parameters, module = generated
    assert module.defaults.items() <= parameters().to_mapping().items()


def test_dynamic_reconfigure_has_the_ranges_of_numbers(generated):
    parameters, module = generated
    numbers = [field for field in parameters.tunable_fields() if field.type in (int, float)]
    expected = {field.name: (describe(field).low, describe(field).high) for field in numbers}
    assert {name: (module.min[name], module.max[name]) for name in expected} == expected


def test_dynamic_reconfigure_accepts_what_it_offers(generated):
    parameters, module = generated
    assert parameters().changed(module.defaults) == parameters()


@pytest.mark.parametrize("name", STAGES)
def test_every_stage_of_the_table_is_checked_here(name):
    assert NODES[name] == (STAGES[name].parameters, STAGES[name].config_name)
