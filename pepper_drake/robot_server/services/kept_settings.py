"""Settings of services that change nothing in the simulation: kept, and told when asked."""

from collections.abc import Mapping
from functools import partial
from typing import Any

Setting = tuple[str, Any]
"""Name of the method that tells a setting, and its first value."""


def keep_settings(module: object, settings: Mapping[str, Setting], returns: Any = None) -> None:
    """Gives a service the methods that set and tell its settings.

    Args:
        module: The service's implementation.
        settings: By the name of the method that sets one; several may set the same.
        returns: What a method that sets one returns.
    """
    values = dict(settings.values())

    def put(getter: str, *arguments: Any) -> Any:
        values[getter] = arguments[0] if len(arguments) == 1 else list(arguments)
        return returns

    for setter, (getter, _) in settings.items():
        setattr(module, setter, partial(put, getter))
        setattr(module, getter, partial(values.__getitem__, getter))
