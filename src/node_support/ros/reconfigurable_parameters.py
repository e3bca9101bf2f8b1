"""Parameters of a running stage: read and validated at start-up, changed through dynamic_reconfigure."""

import importlib
from types import ModuleType
from typing import Any, Callable, Mapping, Type, TypeVar

import rospy
from dynamic_reconfigure.server import Server

from node_support.health import Health
from node_support.parameters import EXPERT, OLD_KEYS, ParameterError, ParameterSet, config_name, describe

Parameters = TypeVar("Parameters", bound=ParameterSet)


class _Server(Server):
    """Leaves values as they were sent, so that a value out of range is refused and not bent into it.

    On the parameter server the values stand where a `ParameterSet` reads them: those for experts under `expert`.
    """

    def __init__(self, module: ModuleType, parameters: ParameterSet, namespace: str, request: Callable) -> None:
        self._parameters = parameters
        super().__init__(module, request, "" if namespace == "~" else namespace)

    def _clamp(self, config: dict) -> None:
        pass

    def _copy_from_parameter_server(self) -> None:
        values = self._parameters.to_mapping()
        self.config.update({field.name: values[field.name] for field in self._parameters.tunable_fields()})

    def _copy_to_parameter_server(self) -> None:
        """Write what differs: each value is a call to the master, and nodes have up to 15."""
        held = rospy.get_param(self.ns.rstrip("/"), {}) or {}
        for field in self._parameters.tunable_fields():
            folder = f"{EXPERT}/" if describe(field).expert else ""
            beside = held.get(EXPERT) or {} if folder else held
            if beside.get(field.name) != self.config[field.name]:
                rospy.set_param(f"{self.ns}{folder}{field.name}", self.config[field.name])


def kept_by_master(namespace: str) -> str:
    """Return where a refused value stands: also the next start reads it there."""
    name = rospy.resolve_name(namespace).rstrip("/")
    return f"(rosparam get {name} shows what is set; the master keeps it until rosparam delete {name})"


def read_parameters(parameters: Type[Parameters], namespace: str) -> Parameters:
    """Return what the parameter server holds in `namespace` ("~", or a resolved name).

    One warning names keys of older versions and those outside of `expert` that belong there. The parameter server then
    holds them where they belong. Raises ParameterError for an unknown key or a value that is not allowed.
    """
    given = rospy.get_param(namespace, {}) or {}
    try:
        values, remarks = parameters.by_name(given)
        found = parameters(**values)
    except ParameterError as error:
        raise ParameterError(f"{error} {kept_by_master(namespace)}") from error
    outside = [key for key in parameters.expert_names() if key in given]
    if outside:
        remarks.append(f"under {EXPERT} belong {', '.join(outside)}, whose values go before those that stand there")
    if remarks:
        rospy.logwarn("%s: %s: %s", rospy.resolve_name(namespace), OLD_KEYS, "; ".join(remarks))
        rospy.set_param(namespace, parameters.nested(values))
    return found


class ReconfigurableParameters:
    """Holds the current, always valid `ParameterSet` of one stage."""

    def __init__(
        self, parameters: Type[ParameterSet], namespace: str, health: Health, on_change: Callable[[ParameterSet], None]
    ) -> None:
        """Read `namespace` ("~", or a resolved name) and serve the .cfg file of the node that `health` names.

        `on_change` is called with the first values and with every accepted change. Raises ParameterError when the
        parameter server holds an unknown key or a value that is not allowed.
        """
        self.current = read_parameters(parameters, namespace)
        self._on_change = on_change
        self._health = health
        on_change(self.current)
        module = importlib.import_module(f"underwater_map_construction.cfg.{config_name(health.name)}Config")
        self._server = _Server(module, self.current, namespace, self._request)

    def change(self, changes: Mapping[str, Any]) -> None:
        """Change tunable parameters as dynamic_reconfigure would; raises ParameterError for what is not allowed."""
        self.current.changed(changes)
        self._server.update_configuration(dict(changes))

    def _request(self, config: dict, _level: int) -> dict:
        changes = {field.name: config[field.name] for field in self.current.tunable_fields()}
        try:
            wanted = self.current.changed(changes)
        except ParameterError as error:
            self._health.answered_problem("changes of parameters refused", f"{error}; nothing was changed")
            wanted = self.current
        if wanted != self.current:
            before, self.current = self.current.to_mapping(), wanted
            self._on_change(wanted)
            changed = [f"{key} = {value!r}" for key, value in wanted.to_mapping().items() if value != before[key]]
            rospy.loginfo("%s: %s", self._health.name, ", ".join(changed))
        config.update({key: value for key, value in wanted.to_mapping().items() if key in changes})
        return config
