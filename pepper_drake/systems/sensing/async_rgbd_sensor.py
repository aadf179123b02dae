"""A camera whose images are rendered while the simulation continues."""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
from pydrake.common.value import Value
from pydrake.systems.framework import Context

from pepper_drake.perception.cameras.image_future import ImageFuture, empty_image
from pepper_drake.systems.framework import LeafSystem


class AsyncRgbdSensor(LeafSystem):
    """Starts rendering a camera's image when its output is evaluated.

    .. pydrake_system::

        name: AsyncRgbdSensor
        input_ports:
        - positions
        output_ports:
        - image

    `positions` are the true positions of everything that moves; `image` is an ImageFuture, for a
    CameraModel with `background` set. Unlike Drake's RgbdSensorAsync it renders only images that
    are requested.

    Stateless; `image` feeds through.

    Args:
        render: Starts rendering for the positions (n,).
        num_positions: Number n of positions.
    """

    def __init__(
        self,
        render: Callable[[npt.NDArray[np.float64]], ImageFuture],
        num_positions: int,
    ) -> None:
        super().__init__()
        self._render = render
        self._positions = self.DeclareVectorInputPort("positions", num_positions)
        self.DeclareAbstractOutputPort(
            "image",
            lambda: Value(empty_image()),
            self._calc_image,
            prerequisites_of_calc={self.input_port_ticket(self._positions.get_index())},
        )

    def _calc_image(self, context: Context, output: Value) -> None:
        output.set_value(self._render(self._positions.Eval(context)))
