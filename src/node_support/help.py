"""What nodes and tools answer to --help, without a ROS master: purpose, topics, services and parameters."""

import argparse
import dataclasses
import math
import re
import signal
import sys
import textwrap
from contextlib import contextmanager
from enum import Enum
from typing import IO, Iterator, List, Mapping, Optional, Type

from node_support.files import PACKAGE
from node_support.node_table import DIAGNOSTICS, HOSTS, NODES, Interface, Role
from node_support.parameters import ParameterSet, describe

# What the narrowest common terminal shows.
WIDTH = 80

_LINK = re.compile(r"\[([^]]*)\]\(([^)]*)\)")
_NOTHING: Mapping[str, Type[ParameterSet]] = {}


class CommandLine(argparse.ArgumentParser):
    """An ArgumentParser that ends quietly when nobody reads the rest of its help."""

    def print_help(self, file: Optional[IO[str]] = None) -> None:
        """Print the help on `file`, standard output unless told otherwise."""
        write_help(self.format_help().rstrip("\n"), file or sys.stdout)


@contextmanager
def ending_in_one_line(program: str, *refused: Type[Exception]) -> Iterator[None]:
    """End the process with one line and status 1 for an error of the classes `refused`, an OSError, and for Ctrl-C."""
    try:
        yield
    except refused as error:
        sys.exit(f"{program}: {error}")
    except OSError as error:
        sys.exit(f"{program}: {error.filename or 'output'}: {error.strerror or error}")
    except KeyboardInterrupt:
        sys.exit(f"{program}: interrupted")


def positive(text: str) -> float:
    """Return the number above 0 that an argument of a command line gives; raises ArgumentTypeError, ValueError."""
    value = float(text)
    if not 0.0 < value < math.inf:
        raise argparse.ArgumentTypeError(f"{text}: must be above 0")
    return value


def write_help(text: str, file: IO[str]) -> None:
    """Write a text and flush it; a closed pipe ends the process without a word, as it ends other Unix programs.

    Python ignores the signal otherwise, which nodes need for their sockets.
    """
    before = signal.signal(signal.SIGPIPE, signal.SIG_DFL)
    try:
        print(text, file=file, flush=True)
    finally:
        signal.signal(signal.SIGPIPE, before)


def answer_help(
    node: str, parameters: Optional[Type[ParameterSet]], groups: Mapping[str, Type[ParameterSet]] = _NOTHING,
    tunable: bool = True,
) -> None:  # fmt: skip
    """Print the help of a node and end the process, if its command line asks for help; otherwise do nothing.

    parameters: those in the node's own namespace; None for a node that hosts others. groups: those in namespaces below
    it, by their names. tunable: whether dynamic_reconfigure can change parameters while the node runs.
    """
    if {"-h", "--help"} & {*sys.argv[1:]}:
        text = host_help(node) if parameters is None else node_help(node, {"": parameters, **groups}, tunable)
        write_help(text, sys.stdout)
        sys.exit(0)


def node_help(node: str, groups: Mapping[str, Type[ParameterSet]], tunable: bool) -> str:
    """Return the help of a node; `groups` are its parameters by namespace, "" is its own. Raises KeyError."""
    description = NODES[node]
    lines = [_usage(node), "", *_wrapped(_plain(description.summary), "")]
    for role in Role:
        lines += _interfaces(role, [one for one in (*description.interfaces, DIAGNOSTICS) if one.role is role])
    for group, parameters in groups.items():
        lines += _parameters(group, parameters, tunable)
    lines += ["", *_wrapped(f"yaml/{node}_default.yaml holds all parameters with their defaults.", "")]
    return "\n".join(lines)


def host_help(host: str) -> str:
    """Return the help of a node that hosts others. Raises KeyError."""
    description = HOSTS[host]
    hosted = ", ".join(description.hosted)
    lines = [_usage(host), "", *_wrapped(_plain(description.summary), "")]
    lines += ["", "hosts:", *_wrapped(hosted, "  ")]
    lines += [
        "",
        *_wrapped(
            "Topics, services and parameters are those of the hosted nodes, in the same namespaces as if each ran "
            "alone (/thresholder/mode). They are listed by:",
            "",
        ),
        *(f"  rosrun {PACKAGE} {node} --help" for node in description.hosted),
        "",
        "parameters:",
        "  chain: a list of node names",
        *_wrapped("the stages that are hosted; default [thresholder, outlier_remover, echo_extractor]", "      "),
        "  detectors: a list of node names",
        *_wrapped("line_detector, circle_detector or both; default [], launch files set it if shapes:=true", "      "),
    ]
    return "\n".join(lines)


def _usage(node: str) -> str:
    return (
        f"usage: rosrun {PACKAGE} {node} [_PARAMETER:=VALUE ...] [TOPIC:=OTHER_TOPIC ...]\n"
        f"   or: roslaunch {PACKAGE} {node}.launch [ARGUMENT:=VALUE ...]"
    )


def _interfaces(role: Role, interfaces: List[Interface]) -> List[str]:
    if not interfaces:
        return []
    lines = ["", f"{role.value}:"]
    for one in interfaces:
        lines.append(f"  {one.name}" + (f" ({one.type})" if one.type else ""))
        lines += _wrapped(_plain(one.text), "      ")
    return lines


def _parameters(group: str, parameters: Type[ParameterSet], tunable: bool) -> List[str]:
    title = f"parameters in the group {group}" if group else "parameters"
    note = " (*: can be changed while the node runs, through dynamic_reconfigure)" if tunable else ""
    lines = ["", *_wrapped(f"{title}{note}:", "")]
    prefix = f"{group}/" if group else ""
    for field in dataclasses.fields(parameters):
        described = describe(field)
        star = " *" if tunable and described.tunable else ""
        default = field.default.value if isinstance(field.default, Enum) else field.default
        lines.append(f"  {prefix}{field.name}{star}")
        lines += _wrapped(f"{described.text}; {described.allowed(field.type)}; default {default!r}", "      ")
    return lines


def _plain(markdown: str) -> str:
    """Return a text of the table without the marks of Markdown; links become the page's path."""
    return _LINK.sub(lambda link: f"{link[1]} (docs/{link[2].partition('#')[0]})", markdown).replace("`", "")


def _wrapped(text: str, indent: str) -> List[str]:
    return textwrap.wrap(text, WIDTH, initial_indent=indent, subsequent_indent=indent, break_on_hyphens=False)
