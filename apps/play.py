"""Play recorded runs back in a browser, from their files: nothing is simulated.

  play.py out/reach                     a run of reach.py: pause, step, scrub, change the speed
  play.py out/reach out/other           several runs over one another, and their figures
  play.py my_motion/ primitive.yaml     demonstrations and primitives, too
  play.py out/reach --html run.html     a page that opens in any browser, without a network
  play.py out/reach --video run.mp4     a film
  play.py out/reach --export rosbag2    a file for another tool: tum, csv, choregraphe, lerobot,
                                        mcap, rosbag2

The window stays when the app has ended, and what is played next appears in it; play.py --stop ends
it. Keys in the window: space plays and pauses, the arrows step, - and + change the speed.
"""

import time
from argparse import ArgumentParser, Namespace
from collections.abc import Sequence
from pathlib import Path
from subprocess import Popen
from typing import TYPE_CHECKING

from pepper_drake import cli
from pepper_drake.errors import InputError
from pepper_drake.playback import server

if TYPE_CHECKING:
    from pepper_drake.playback.bodies import Frames


def make_parser() -> ArgumentParser:
    """Makes the parser of this app's options."""
    parser = cli.make_parser("play", __doc__)
    add = parser.add_argument
    add(
        "runs",
        nargs="*",
        type=Path,
        metavar="RUN",
        help="a run's folder, a demonstration, or a primitive's YAML file",
    )
    add("--from-arm", action="store_true", help="begin when the arm starts: runs keep in step")
    add(
        "--zmq-url",
        default=server.DEFAULT_URL,
        metavar="URL",
        help="the meshcat server to draw into; started if there is none (default: %(default)s)",
    )
    add("--html", type=Path, metavar="FILE", help="write a page instead, into the output folder")
    add(
        "--video",
        type=Path,
        metavar="FILE",
        help="write a film (.mp4 or .gif), into the output folder",
    )
    add(
        "--export",
        metavar="FORM",
        help="write a file for another tool: tum, csv, choregraphe, lerobot, mcap or rosbag2",
    )
    cli.add_host_option(parser)
    add("--stop", action="store_true", help="end the server that play.py started, and its window")
    return parser


def load(paths: Sequence[Path], *, from_arm: bool) -> "list[Frames]":
    """Loads runs, demonstrations and primitives to play back."""
    # Imported while the server starts: most of the startup time.
    from pepper_drake.playback.bodies import replay_frames
    from pepper_drake.playback.loading import load_motion

    return [replay_frames(load_motion(path), from_arm=from_arm) for path in paths]


def show_in_window(options: Namespace) -> "tuple[list[Frames], str]":
    """Draws the runs in the server's window; returns them and its web address."""
    started: Popen[bytes] | None = None
    if not server.is_listening(options.zmq_url):
        started = server.start_server(options.zmq_url, options.host)
    try:
        runs = load(options.runs, from_arm=options.from_arm)
        from pepper_drake.playback.drawing import draw

        commands = draw(runs)
        if started is not None:
            server.wait_for_server(options.zmq_url, started)
        web_url = server.send(commands, options.zmq_url)
        if started is not None:
            server.keep_server(started)
        return runs, web_url
    except BaseException:
        if started is not None:
            started.terminate()
        raise


def write_files(options: Namespace) -> "list[Frames]":
    """Writes the page, the video, or both."""
    runs = load(options.runs, from_arm=options.from_arm)
    folder: Path = options.output
    if options.html is not None:
        from pepper_drake.playback.page import write_page

        write_page(runs, folder / options.html)
    if options.video is not None:
        from pepper_drake.playback.video import write_video

        hidden = not cli.shows_progress(options)
        write_video(runs, folder / options.video, progress=not hidden)
    return runs


def main() -> int:
    """Runs the app."""
    begin = time.perf_counter()
    options = cli.parse(make_parser())
    if options.stop:
        server.quit_server(options.zmq_url)
        return cli.EXIT_DONE
    if not options.runs:
        raise InputError("no RUN to play back; give the folder of one, such as out/reach")
    if options.export is not None:
        from pepper_drake.playback.exports import export
        from pepper_drake.playback.loading import load_motion

        for run in options.runs:
            path = export(load_motion(run), options.export, options.output)
            if not options.quiet:
                print(f"Wrote {path}")
        return cli.EXIT_DONE
    if options.html is None and options.video is None:
        runs, web_url = show_in_window(options)
        result = cli.as_run(f"Open {web_url} in a browser; play.py --stop ends it")
    else:
        runs = write_files(options)
        written = [options.output / f for f in (options.html, options.video) if f is not None]
        result = f"Wrote {' and '.join(map(str, written))}"
    if not options.quiet:
        from pepper_drake.playback.comparison import table

        print(table(runs))
        print(f"{result}; {time.perf_counter() - begin:.1f} s")
    return cli.EXIT_DONE


if __name__ == "__main__":
    cli.run(main)
