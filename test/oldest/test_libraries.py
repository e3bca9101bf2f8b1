"""What the sources ask of Python and of other libraries is there, also in lines that no test runs."""

import ast
import importlib
import inspect
from pathlib import Path

from ros_modules import CompiledModuleError

SOURCES = Path(__file__).resolve().parents[2] / "src"
FILES = sorted(SOURCES.rglob("*.py"))
OWN = {path.name for path in SOURCES.iterdir()}


def _imported(name):
    """Return a module, None where it is compiled for another Python or, as some are, not installed here."""
    try:
        return importlib.import_module(name)
    except CompiledModuleError:
        return None
    except ModuleNotFoundError as error:
        if str(error.name).partition(".")[0] in OWN:
            raise
        return None


def test_every_module_can_be_imported():
    names = [".".join(path.relative_to(SOURCES).with_suffix("").parts) for path in FILES]
    for name in names:
        try:
            importlib.import_module(name)
        except CompiledModuleError:
            assert ".ros." in name or name.startswith("underwater_map_construction"), name


def _bound(tree):
    """Return the modules and other objects of foreign libraries by the names that a file gives them, each one only."""
    found = {}
    for name, thing in _imports(tree):
        if thing is not None and not _is_ours(thing):
            found.setdefault(name, {})[id(thing)] = thing
    return {name: next(iter(things.values())) for name, things in found.items() if len(things) == 1}


def _imports(tree):
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for one in node.names:
                module, whole = _imported(one.name), _imported(one.name.partition(".")[0])
                yield (one.asname, module) if one.asname else (one.name.partition(".")[0], whole)
        elif isinstance(node, ast.ImportFrom):
            module = _imported(node.module)
            yield from ((one.asname or one.name, getattr(module, one.name, None)) for one in node.names)


def _is_ours(thing):
    name = getattr(thing, "__module__", None) or getattr(thing, "__name__", "")
    return str(name).partition(".")[0] in OWN


def _parts(node):
    """Return the words of a dotted name, none of other expressions."""
    if isinstance(node, ast.Name):
        return [node.id]
    parts = _parts(node.value) if isinstance(node, ast.Attribute) else []
    return [*parts, node.attr] if parts else []


def _resolved(parts, bound):
    """Return what a dotted name means, and the word that is not there, "" where all are; instances are not asked."""
    thing = bound[parts[0]]
    for part in parts[1:]:
        if not (inspect.ismodule(thing) or inspect.isclass(thing)):
            return None, ""
        if not hasattr(thing, part):
            return None, part
        thing = getattr(thing, part)
    return thing, ""


def _unknown_keywords(function, call):
    try:
        parameters = inspect.signature(function).parameters
    except (TypeError, ValueError):
        return []  # of compiled functions nothing is known
    if any(one.kind is one.VAR_KEYWORD for one in parameters.values()):
        return []
    return [word.arg for word in call.keywords if word.arg and word.arg not in parameters]


def _complaints(path):
    tree = ast.parse(path.read_text())
    bound = _bound(tree)
    for node in ast.walk(tree):
        parts = _parts(node.func if isinstance(node, ast.Call) else node)
        if not parts or parts[0] not in bound:
            continue
        thing, missing = _resolved(parts, bound)
        words = _unknown_keywords(thing, node) if isinstance(node, ast.Call) and callable(thing) else []
        for word in [missing] * bool(missing) + words:
            yield f"{path.relative_to(SOURCES)}:{node.lineno}: {'.'.join(parts)}: no {word}"


def test_every_name_and_keyword_of_other_libraries_is_there():
    assert [line for path in FILES for line in _complaints(path)] == []
