"""Parameters from yaml files and from KEY=VALUE."""

import pytest

from node_support.parameter_files import assigned_values, read_values
from node_support.parameters import ParameterError


def test_a_file_gives_its_values_by_their_keys(tmp_path):
    (tmp_path / "own.yaml").write_text("resolution: 0.1\nsonar: {rays: 15}\n")
    assert read_values(tmp_path / "own.yaml") == {"resolution": 0.1, "sonar": {"rays": 15}}


@pytest.mark.parametrize(
    ("content", "fault"),
    [(b"a: [", "not yaml"), (b"\xff", "not yaml"), (b"- 1", "must hold lines of KEY: VALUE"), (b"", "must hold lines")],
)
def test_a_file_without_values_is_refused_by_its_name(tmp_path, content, fault):
    (tmp_path / "own.yaml").write_bytes(content)
    with pytest.raises(ParameterError, match=rf"own\.yaml: {fault}"):
        read_values(tmp_path / "own.yaml")


def test_a_missing_file_is_refused_by_its_name(tmp_path):
    with pytest.raises(ParameterError, match=r"own\.yaml: No such file"):
        read_values(tmp_path / "own.yaml")


def test_of_several_values_for_one_key_the_last_one_counts():
    assert assigned_values(["seed=1", "name=a=b", "seed=2"]) == {"seed": 2, "name": "a=b"}


@pytest.mark.parametrize("text", ["seed", "=1", "", "seed=["])
def test_a_text_without_key_or_value_is_refused(text):
    with pytest.raises(ParameterError, match="--set"):
        assigned_values([text])
