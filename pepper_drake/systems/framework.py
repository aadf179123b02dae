"""Drake's LeafSystem and Diagram as bases of Python classes that are freed when nobody uses them.

On Python 3.11 and 3.12 pybind11 shows the attributes of an instance of a Python subclass to the
garbage collector twice: once as the base class's and once as the subclass's. A system and its ports
refer to one another, and the collector, which counts references, never finds such a circle unused.
A class with empty `__slots__` brings no attributes of its own; its instances keep theirs, as they
are, where the base class has them.

What Drake calls to compute an output or a cache entry is kept in C++, where the collector does not
look at all. So functions are handed over with weak references to their system.
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
    """Makes classes whose instances have no attributes of their own; see above."""

    def __new__(
        cls, name: str, bases: tuple[type, ...], namespace: dict[str, Any], **options: Any
    ) -> "_Collectable":
        namespace.setdefault("__slots__", ())
        # Drake makes the constructor of a system for a scalar type, `(*args, **kwargs)`.
        constructor = namespace.get("_construct") or namespace.get("__init__")
        if constructor is not None:
            whole = shortened(constructor)
            given = [p for name, p in whole.parameters.items() if name != "converter"]
            namespace["__signature__"] = whole.replace(parameters=given)
        return super().__new__(cls, name, bases, namespace, **options)


class CacheEntry:
    """A cache entry of a system, which it may keep; Drake's own keeps the system in turn."""

    def __init__(self, system: Any, entry: framework.CacheEntry) -> None:
        self._system, self._index = weakref.proxy(system), entry.cache_index()
        self._ticket = entry.ticket()

    def Eval(self, context: framework.Context) -> Any:
        """Returns the entry's value, computed anew if need be."""
        return self._system.get_cache_entry(self._index).Eval(context)

    def ticket(self) -> framework.DependencyTicket:
        """Returns its dependency ticket."""
        return self._ticket


@cache
def leaf_system(base: type) -> Any:
    """Returns a LeafSystem of a scalar type as a base of Python classes.

    Args:
        base: Such as `LeafSystem_[T]`.
    """

    class LeafSystem(base, metaclass=_Collectable):
        """A LeafSystem that is freed when nobody uses it."""

        def DeclareVectorOutputPort(self, *args: Any, **options: Any) -> OutputPort:
            """As Drake's."""
            return super().DeclareVectorOutputPort(*map(_weak, args), **_all_weak(options))

        def DeclareAbstractOutputPort(self, *args: Any, **options: Any) -> OutputPort:
            """As Drake's."""
            return super().DeclareAbstractOutputPort(*map(_weak, args), **_all_weak(options))

        def DeclareCacheEntry(self, *args: Any, **options: Any) -> CacheEntry:
            """As Drake's; its ValueProducer is to be of this module."""
            return CacheEntry(self, super().DeclareCacheEntry(*args, **options))

    return LeafSystem


LeafSystem = leaf_system(framework.LeafSystem)


def build_into(builder: framework.DiagramBuilder, diagram: framework.Diagram) -> None:
    """Builds a diagram of all that a builder has been given, and empties the builder.

    Drake keeps systems alive by the builder, and the builder by what some of its methods return,
    where the garbage collector does not look. Afterwards the diagram keeps them itself.

    Args:
        builder: Not needed any more afterwards.
        diagram: An instance of a subclass in its making.
    """
    builder.BuildInto(diagram)
    _hand_over(builder, diagram)


def build(builder: framework.DiagramBuilder) -> framework.Diagram:
    """Returns a diagram of all that a builder has been given; see `build_into`."""
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
        builder: Of the diagram that both systems are in.
        source: Has the outputs.
        target: Has the inputs.
        names: Of ports that have the same name on both sides.
        renamed: The input's name by the output's.
    """
    for name, port in (*zip(names, names, strict=True), *renamed.items()):
        builder.Connect(source.GetOutputPort(name), target.GetInputPort(port))


def export_input(builder: framework.DiagramBuilder, name: str, *ports: framework.InputPort) -> None:
    """Makes one input of the diagram of all these inputs."""
    builder.ExportInput(ports[0], name)
    for port in ports[1:]:
        builder.ConnectInput(name, port)


def release(diagram: framework.Diagram, *others: framework.System) -> None:
    """Lets a diagram of `build` go on this thread as soon as its last user does.

    What renders has to go on the thread that made it; the garbage collector runs on any.

    Args:
        diagram: Of systems of C++ alone; nothing may be asked of it any more.
        others: Systems that belong to it without being in it.
    """
    parts = [part for peers in vars(diagram).pop("_kept").values() for part in peers]
    for part in (*parts, *others):
        vars(part).clear()


def _hand_over(builder: framework.DiagramBuilder, diagram: framework.Diagram) -> None:
    diagram._kept = dict(vars(builder))
    vars(builder).clear()


def ValueProducer(allocate: Callable[[], Any], calc: Callable[..., object]) -> Any:
    """Returns Drake's ValueProducer of a cache entry."""
    return framework.ValueProducer(allocate=_weak(allocate), calc=_weak(calc))


class Diagram(framework.Diagram, metaclass=_Collectable):
    """A Diagram that is freed when nobody uses it."""

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

        Drake lets what its functions return keep what they were given: a root context that is
        returned as it is would keep itself, and the simulator that owns it, for ever.
        """
        try:
            self.ValidateContext(context)
        except RuntimeError:
            return False
        return True


def _weak(value: Any) -> Any:
    """Returns a function that keeps no system; what is no function is returned as it is.

    Bound methods get a weak reference to their object; in closures and partial functions, systems
    and their ports become weak proxies.
    """
    if isinstance(value, MethodType):
        method = weakref.WeakMethod(value)

        def call(*args: Any) -> Any:
            bound = method()
            assert bound is not None, "Drake computes nothing of a system that is gone"
            return bound(*args)

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
    # A port keeps its system, which keeps the port: it is there as long as it may be asked for.
    if isinstance(value, framework.SystemBase) or hasattr(type(value), "get_system"):
        return weakref.proxy(value)
    return value


def _all_weak(options: dict[str, Any]) -> dict[str, Any]:
    return {name: _weak(value) for name, value in options.items()}
