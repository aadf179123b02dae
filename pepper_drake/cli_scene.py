"""Command-line options that choose a scene."""

from argparse import ArgumentParser, Namespace

from pepper_drake import cli
from pepper_drake.errors import InputError
from pepper_drake.models.random_scene import random_scene
from pepper_drake.models.scene import SCENES, Scene, load_scene
from pepper_drake.models.scene_families import FAMILIES, family_scene


def add_scene_options(parser: ArgumentParser) -> None:
    """Adds `--scene` and `--random-scene`, one of which may be given."""
    scenes = parser.add_mutually_exclusive_group()
    scenes.add_argument(
        "--scene",
        metavar="NAME|FILE",
        help=f"one of {', '.join(SCENES)}, or a scene's YAML file (default: the scenario's, table)",
    )
    scenes.add_argument(
        "--random-scene", type=cli.seed, metavar="SEED", help="a random scene instead"
    )
    parser.add_argument(
        "--family",
        choices=FAMILIES,
        metavar="NAME",
        help=f"random scenes of a family: {', '.join(FAMILIES)}",
    )
    parser.add_argument(
        "--moving",
        action="store_true",
        help="with --random-scene: something moves over the table once the arm starts",
    )


def chosen_scene(options: Namespace, default: Scene | None = None) -> Scene:
    """The scene that the options of `add_scene_options` name.

    Args:
        options: The app's.
        default: The scene if they name none; the table if None.

    Raises:
        InputError: There is no such scene, or its file is wrong.
    """
    if options.moving and options.random_scene is None:
        raise InputError("--moving is for random scenes; name one with --random-scene")
    if options.family is not None:
        if options.random_scene is None:
            raise InputError("--family is for random scenes; name one with --random-scene")
        return family_scene(options.family, options.random_scene, moving=options.moving)
    if options.random_scene is not None:
        return random_scene(options.random_scene, moving=options.moving)
    if options.scene is None and default is not None:
        return default
    return load_scene(options.scene or "table")
