"""Writes the default yaml files and the tables of the documents anew, for the nodes that the tests know."""

from pathlib import Path

from test_parameter_files import NODES

from node_support.parameter_text import default_yaml, with_tables

ROOT = Path(__file__).resolve().parents[1]


def main() -> None:
    """Write all files."""
    parameters = {node: kind for node, (kind, _) in NODES.items()}
    for node, kind in parameters.items():
        (ROOT / "yaml" / f"{node}_default.yaml").write_text(default_yaml(node, kind))
    for document in (ROOT / "docs").glob("*.md"):
        document.write_text(with_tables(document.read_text(), parameters))


if __name__ == "__main__":
    main()
