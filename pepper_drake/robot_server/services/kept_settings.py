"""Settings of services without effect in the simulation: stored, and returned on request."""

from collections.abc import Mapping
from functools import partial
from typing import Any

Setting = tuple[str, Any]
"""Name of the method that returns a setting, and its initial value."""


def keep_settings(module: object, settings: Mapping[str, Setting], returns: Any = None) -> None:
    """Gives a service the methods that set and return its settings.

    Args:
        module: The service's implementation.
        settings: By the name of the setter; several setters may share a setting.
        returns: Return value of the setters.
    """
    values = dict(settings.values())

    def put(getter: str, *arguments: Any) -> Any:
        values[getter] = arguments[0] if len(arguments) == 1 else list(arguments)
        return returns

    for setter, (getter, _) in settings.items():
        setattr(module, setter, partial(put, getter))
        setattr(module, getter, partial(values.__getitem__, getter))
