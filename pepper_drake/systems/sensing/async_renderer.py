"""Renders camera images on a separate thread while the simulation continues."""

import threading
import weakref
from collections.abc import Callable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor

import numpy as np
import numpy.typing as npt
from pydrake.common.value import Value
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, DiagramBuilder
from pydrake.systems.primitives import ZeroOrderHold
from pydrake.systems.sensors import ImageDepth32F, ImageRgba8U

from pepper_drake.models.scene import Scene
from pepper_drake.perception.cameras.camera import HeadCamera
from pepper_drake.perception.cameras.image_future import ImageFuture, Pixels
from pepper_drake.systems.framework import build, release
from pepper_drake.systems.sensing.rendered_scene import RenderedScene


class _RenderingDiagram:
    """Pepper in a scene as pure geometry, with cameras; belongs to the thread that made it.

    Rendering happens inside `Simulator.AdvanceTo` because that releases the GIL; evaluating the
    sensor's port does not.
    """

    def __init__(self, scene: Scene, cameras: Mapping[str, tuple[HeadCamera, str]]) -> None:
        builder = DiagramBuilder()
        rendered = RenderedScene(builder, scene, {name: cameras[name][0] for name in cameras})
        self._plant = rendered.plant
        self._images = {}
        for offset, (name, (_, kind)) in enumerate(cameras.items()):
            sensor, is_color = rendered.sensors[name], kind == "color"
            # Each camera samples in its own second of the diagram's time.
            image = builder.AddSystem(
                ZeroOrderHold(
                    period_sec=len(cameras),
                    abstract_model_value=Value(ImageRgba8U() if is_color else ImageDepth32F()),
                    offset_sec=offset,
                )
            )
            builder.Connect(
                sensor.color_image_output_port()
                if is_color
                else sensor.depth_image_32F_output_port(),
                image.get_input_port(),
            )
            self._images[name] = (offset, image.get_output_port())
        self._diagram = build(builder)
        self._simulator = Simulator(self._diagram)
        self._rounds = 0

    def __del__(self) -> None:
        """Frees the renderer on this thread."""
        self._images.clear()
        release(self._diagram, self._plant)

    def default_positions(self) -> npt.NDArray[np.float64]:
        """Returns the plant's default positions."""
        return self._plant.GetPositions(self._plant.CreateDefaultContext())

    def render(self, camera: str, positions: npt.NDArray[np.float64]) -> Pixels:
        """Renders a camera's image (height, width, channels)."""
        offset, image = self._images[camera]
        context: Context = self._simulator.get_mutable_context()
        self._diagram.GetInputPort("positions").FixValue(context, positions)
        self._rounds += 1
        time = self._rounds * len(self._images) + offset
        context.SetTime(time - 0.5)
        self._simulator.Initialize()
        self._simulator.AdvanceTo(time + 0.25)
        return image.Eval(image.get_system().GetMyContextFromRoot(context)).data.copy()


class AsyncRenderer:
    """Renders the head cameras' images on one thread, in the order of the requests.

    An image depends on the camera and the positions alone, so simulations may share a renderer.

    Args:
        scene: The scene.
        cameras: By name: the camera and the kind of image, "color" or "depth".
    """

    def __init__(self, scene: Scene, cameras: Mapping[str, tuple[HeadCamera, str]]) -> None:
        executor = ThreadPoolExecutor(1, thread_name_prefix="renderer")
        self._executor = executor
        self._started = executor.submit(_start, scene, cameras)
        self._prepared: list[Future[object]] = []
        # At exit Python itself ends the threads of executors.
        weakref.finalize(self, executor.shutdown, wait=False).atexit = False

    def prepare(self, work: Callable[[], object]) -> None:
        """Runs a function on the thread before it counts as ready."""
        self._prepared.append(self._executor.submit(work))

    def wait_until_ready(self) -> None:
        """Waits until the scene is built, the shaders are compiled, and `prepare` has finished."""
        self._started.result()
        for work in self._prepared:
            work.result()

    def render(self, camera: str, positions: npt.NDArray[np.float64]) -> ImageFuture:
        """Starts rendering.

        Args:
            camera: Its name.
            positions: Positions of a plant with Pepper and then the scene.

        Returns:
            The image: ImageRgba8U's pixels (height, width, 4), or depths (height, width, 1) [m].
        """
        started = self._started

        def render() -> Pixels:
            started.result()  # Raises if the renderer failed to start.
            return _THREAD_LOCAL.rendering.render(camera, positions)

        return ImageFuture(self._executor.submit(render), self._executor)


class _ThreadLocal(threading.local):
    """Objects freed on their own thread when it ends: OpenGL demands it."""

    rendering: _RenderingDiagram


_THREAD_LOCAL = _ThreadLocal()


def _start(scene: Scene, cameras: Mapping[str, tuple[HeadCamera, str]]) -> None:
    """Makes the rendering diagram and compiles its shaders, which takes most of the time."""
    rendering = _RenderingDiagram(scene, cameras)
    for camera in cameras:
        rendering.render(camera, rendering.default_positions())
    _THREAD_LOCAL.rendering = rendering
