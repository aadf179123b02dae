"""A stand-alone page that plays motions back, in any browser or a notebook's cell."""

import base64
import html
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING

from pepper_drake.files import write_atomically
from pepper_drake.playback.bodies import Frames, replay_frames
from pepper_drake.playback.drawing import Command, draw
from pepper_drake.playback.loading import load_motion

if TYPE_CHECKING:
    from IPython.display import HTML

_PAGE = """<!DOCTYPE html>
<html>
<head>
<meta charset="utf-8">
<title>{title}</title>
<style>
body {{ margin: 0; }}
#meshcat-pane {{ width: 100vw; height: 100vh; overflow: hidden; }}
</style>
</head>
<body>
<div id="meshcat-pane"></div>
<script>{viewer}</script>
<script>
var viewer = new MeshCat.Viewer(document.getElementById("meshcat-pane"));
for (const command of [
{commands}
]) {{
  viewer.handle_command_bytearray(Uint8Array.from(atob(command), (c) => c.charCodeAt(0)));
}}
</script>
</body>
</html>
"""


def standalone_page(commands: Sequence[Command], title: str) -> str:
    """Returns a self-contained page (HTML), including meshcat's viewer.

    Args:
        commands: Commands from `draw`.
        title: The page's title.
    """
    viewer = files("meshcat").joinpath("viewer/dist/main.min.js").read_text(encoding="utf-8")
    encoded = ",\n".join(f'"{base64.b64encode(command.data).decode()}"' for command in commands)
    return _PAGE.format(title=html.escape(title), viewer=viewer, commands=encoded)


def write_page(runs: Sequence[Frames], path: Path) -> None:
    """Writes the page that plays motions back, on top of one another.

    Raises:
        InputError: The file cannot be written.
    """
    title = ", ".join(run.motion.name for run in runs)
    write_atomically(path, standalone_page(draw(runs), title))


def show(
    paths: str | Path | Sequence[str | Path], *, height: int = 560, from_arm: bool = False
) -> "HTML":
    """Plays runs back in a notebook's cell, as the cell's last expression.

    The cell is self-contained, so it also works in a saved notebook and on a remote server.

    Args:
        paths: One or several paths as for `load_motion`, drawn on top of one another.
        height: Height of the cell, in pixels.
        from_arm: Whether each motion begins when its arm starts.

    Raises:
        InputError: A path has nothing to play back.
    """
    from IPython.display import HTML

    path_list = [paths] if isinstance(paths, str | Path) else paths
    motions = [load_motion(path) for path in path_list]
    commands = draw([replay_frames(motion, from_arm=from_arm) for motion in motions])
    page = standalone_page(commands, ", ".join(motion.name for motion in motions))
    return HTML(
        f'<div style="height: {height}px; resize: vertical; overflow: hidden">'
        f'<iframe srcdoc="{html.escape(page, quote=True)}" '
        'style="width: 100%; height: 100%; border: none"></iframe></div>'
    )
