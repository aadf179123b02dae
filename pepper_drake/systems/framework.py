"""Drake's LeafSystem and Diagram as bases of Python classes that the garbage collector can free.

On Python 3.11 and 3.12 pybind11 reports the attributes of an instance of a Python subclass to the
garbage collector twice: once for the base class and once for the subclass. A system and its ports
refer to each other, and with the references miscounted the collector never frees such a cycle.
A class with empty `__slots__` has no attribute storage of its own; its instances store their
attributes in the base class's.

Drake keeps the functions that compute outputs and cache entries in C++, where the collector cannot
see them. So they are passed with weak references to their system.
"""

import weakref
from collections.abc import Callable
from functools import cache, partial
from types import CellType, FunctionType, MethodType
from typing import Any

from pydrake.systems import framework
from pydrake.systems.framework import OutputPort

from pepper_drake.short_repr import shortened


class _Collectable(type(framework.LeafSystem)):  # type: ignore[misc]
    """Makes classes without attribute storage of their own; see above."""

    def __new__(
        cls, name: str, bases: tuple[type, ...], namespace: dict[str, Any], **options: Any
    ) -> "_Collectable":
        namespace.setdefault("__slots__", ())
        # Drake generates the constructor of a scalar-templated system as `(*args, **kwargs)`.
        constructor = namespace.get("_construct") or namespace.get("__init__")
        if constructor is not None:
            whole = shortened(constructor)
            given = [p for name, p in whole.parameters.items() if name != "converter"]
            namespace["__signature__"] = whole.replace(parameters=given)
        return super().__new__(cls, name, bases, namespace, **options)


class CacheEntry:
    """A cache entry that its system can store: Drake's own would keep the system alive."""

    def __init__(self, system: Any, entry: framework.CacheEntry) -> None:
        self._system, self._index = weakref.proxy(system), entry.cache_index()
        self._ticket = entry.ticket()

    def Eval(self, context: framework.Context) -> Any:
        """Returns the entry's value, recomputed if out of date."""
        return self._system.get_cache_entry(self._index).Eval(context)

    def ticket(self) -> framework.DependencyTicket:
        """Returns its dependency ticket."""
        return self._ticket


@cache
def leaf_system(base: type) -> Any:
    """Returns a collectable LeafSystem of a scalar type, to derive Python classes from.

    Args:
        base: Such as `LeafSystem_[T]`.
    """

    class LeafSystem(base, metaclass=_Collectable):
        """A LeafSystem that is freed when unused."""

        def DeclareVectorOutputPort(self, *args: Any, **options: Any) -> OutputPort:
            """As Drake's."""
            return super().DeclareVectorOutputPort(*map(_weak, args), **_all_weak(options))

        def DeclareAbstractOutputPort(self, *args: Any, **options: Any) -> OutputPort:
            """As Drake's."""
            return super().DeclareAbstractOutputPort(*map(_weak, args), **_all_weak(options))

        def DeclareCacheEntry(self, *args: Any, **options: Any) -> CacheEntry:
            """As Drake's; takes a ValueProducer of this module."""
            return CacheEntry(self, super().DeclareCacheEntry(*args, **options))

    return LeafSystem


LeafSystem = leaf_system(framework.LeafSystem)


def build_into(builder: framework.DiagramBuilder, diagram: framework.Diagram) -> None:
    """Builds a diagram of a builder's systems, and empties the builder.

    Drake keeps systems alive through the builder, and the builder through what some of its methods
    return, hidden from the garbage collector. Afterwards the diagram itself keeps the systems.

    Args:
        builder: Must not be used afterwards.
        diagram: The Diagram subclass instance being constructed.
    """
    builder.BuildInto(diagram)
    _hand_over(builder, diagram)


def build(builder: framework.DiagramBuilder) -> framework.Diagram:
    """Returns a diagram of a builder's systems; see `build_into`."""
    diagram = builder.Build()
    _hand_over(builder, diagram)
    return diagram


def connect(
    builder: framework.DiagramBuilder,
    source: framework.System,
    target: framework.System,
    *names: str,
    **renamed: str,
) -> None:
    """Connects outputs to inputs of the same name, or of another: `output="input"`.

    Args:
        builder: Builder of the diagram that contains both systems.
        source: System with the outputs.
        target: System with the inputs.
        names: Ports with the same name on both systems.
        renamed: Input names by output name.
    """
    for name, port in (*zip(names, names, strict=True), *renamed.items()):
        builder.Connect(source.GetOutputPort(name), target.GetInputPort(port))


def export_input(builder: framework.DiagramBuilder, name: str, *ports: framework.InputPort) -> None:
    """Exports several inputs as one input of the diagram."""
    builder.ExportInput(ports[0], name)
    for port in ports[1:]:
        builder.ConnectInput(name, port)


def release(diagram: framework.Diagram, *others: framework.System) -> None:
    """Has a diagram made by `build` freed on this thread with its last reference.

    A renderer must be freed on the thread that made it; the garbage collector runs on any.

    Args:
        diagram: Consists of C++ systems only; must not be used afterwards.
        others: Systems that belong to it without being part of it.
    """
    parts = [part for peers in vars(diagram).pop("_kept").values() for part in peers]
    for part in (*parts, *others):
        vars(part).clear()


def _hand_over(builder: framework.DiagramBuilder, diagram: framework.Diagram) -> None:
    diagram._kept = dict(vars(builder))
    vars(builder).clear()


def ValueProducer(allocate: Callable[[], Any], calc: Callable[..., object]) -> Any:
    """Returns Drake's ValueProducer for a cache entry, with weak references to the system."""
    return framework.ValueProducer(allocate=_weak(allocate), calc=_weak(calc))


class Diagram(framework.Diagram, metaclass=_Collectable):
    """A Diagram that is freed when unused."""

    def GetMyContextFromRoot(self, root_context: framework.Context) -> framework.Context:
        """As Drake's."""
        if self._owns(root_context):
            return root_context
        return super().GetMyContextFromRoot(root_context)

    def GetMyMutableContextFromRoot(self, root_context: framework.Context) -> framework.Context:
        """As Drake's."""
        if self._owns(root_context):
            return root_context
        return super().GetMyMutableContextFromRoot(root_context)

    def _owns(self, context: framework.Context) -> bool:
        """Tells whether a context is the diagram's own.

        Drake's bindings make a returned context keep the one passed in alive: a root context
        returned unchanged would keep itself, and the simulator that owns it, alive for ever.
        """
        if self.GetSystemPathname() != f"::{self.GetSystemName()}":
            return False  # It is part of another diagram; an error below would take 0.3 ms.
        try:
            self.ValidateContext(context)
        except RuntimeError:
            return False
        return True


def _weak(value: Any) -> Any:
    """Returns a function that keeps no system alive; returns other values unchanged.

    Bound methods get a weak reference to their object; in closures and partial functions, systems
    and their ports become weak proxies.
    """
    if isinstance(value, MethodType):
        # Not a WeakMethod, whose every call takes longer than that of most methods it is of.
        owner, function = weakref.ref(value.__self__), value.__func__

        def call(*args: Any) -> Any:
            system = owner()
            assert system is not None, "Drake computes nothing of a system that is gone"
            return function(system, *args)

        return call
    if isinstance(value, partial):
        return partial(_weak(value.func), *map(_weak, value.args), **_all_weak(value.keywords))
    if isinstance(value, FunctionType) and value.__closure__:
        cells = tuple(CellType(_weak(cell.cell_contents)) for cell in value.__closure__)
        return FunctionType(
            value.__code__, value.__globals__, value.__name__, value.__defaults__, cells
        )
    if type(value) in (list, tuple):
        return type(value)(map(_weak, value))
    # A port and its system keep each other alive, so the proxy is valid whenever it is used.
    if isinstance(value, framework.SystemBase) or hasattr(type(value), "get_system"):
        return weakref.proxy(value)
    return value


def _all_weak(options: dict[str, Any]) -> dict[str, Any]:
    return {name: _weak(value) for name, value in options.items()}
