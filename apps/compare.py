"""Compare the approximators: the report's table 4.1 and figure 4.5, on your demonstrations.

Fits every demonstration with every approximator, performs it, and measures how far the motion is
from the demonstration (equation 4.1) and how long it took. Writes table.json, table.md and
comparison.png. Without demonstrations it takes ten made-up motions.
"""

import json
from dataclasses import asdict

from tqdm import tqdm

from pepper_drake.cli import EXIT_DONE, make_parser, parse, run, shows_progress
from pepper_drake.evaluation.approximator_comparison import (
    REPORT_NUM_BASIS,
    compare,
    markdown_table,
    reproduce_demonstration,
    strengths,
)
from pepper_drake.learning import approximator_names
from pepper_drake.learning.approximators.registry import get_approximator
from pepper_drake.learning.demonstrations.demonstration_folder import load_all
from pepper_drake.learning.demonstrations.synthetic import example_demonstrations
from pepper_drake.learning.dmp.num_basis import check_num_basis
from pepper_drake.reporting.comparison_figure import draw_comparison
from pepper_drake.results.folder import whole_results
from pepper_drake.user_code import named_part


def main() -> int:
    """Runs the app and returns its exit code."""
    parser = make_parser("compare", __doc__)
    parser.add_argument(
        "demonstrations",
        nargs="*",
        metavar="DEMO",
        help="a demonstration, or a folder in and below which all are taken",
    )
    parser.add_argument(
        "--num-basis",
        nargs="+",
        type=int,
        default=REPORT_NUM_BASIS,
        metavar="N",
        help="numbers of basis functions (default: 20 30 40 50 60)",
    )
    parser.add_argument(
        "--approximators",
        nargs="+",
        default=approximator_names(),
        metavar="NAME",
        help=f"some of {', '.join(approximator_names())}, or FILE.py:NAME of your own "
        "(default: all)",
    )
    arguments = parse(parser)
    known = approximator_names()
    names = [name if name in known else named_part(name) for name in arguments.approximators]
    nums_basis = list(arguments.num_basis)
    for name in names:
        get_approximator(name)
    for number in nums_basis:
        check_num_basis(number, "--num-basis")
    demonstrations = load_all(arguments.demonstrations)
    if not demonstrations:
        demonstrations = example_demonstrations(seed=arguments.seed)

    total = len(names) * len(nums_basis) * len(demonstrations)
    with tqdm(total=total, unit="fit", disable=not shows_progress(arguments)) as bar:
        rows = compare(demonstrations, names, nums_basis, progress=bar.update)

    shown = demonstrations[0]
    middle = sorted(nums_basis)[len(nums_basis) // 2]
    paths = {name: reproduce_demonstration(shown, name, middle)[0] for name in names}
    table = {
        "demonstrations": [demonstration.name for demonstration in demonstrations],
        "rows": [asdict(row) for row in rows],
    }
    with whole_results(arguments.output, ("table.json", "table.md", "comparison.png")) as folder:
        (folder / "table.json").write_text(json.dumps(table, indent=2) + "\n")
        (folder / "table.md").write_text(markdown_table(rows))
        draw_comparison(shown, paths, rows).savefig(folder / "comparison.png", dpi=120)
    if not arguments.quiet:
        print(markdown_table(rows))
        print("\n".join(strengths(rows)))
        print(f"written to {arguments.output}: table.json, table.md, comparison.png")
    return EXIT_DONE


if __name__ == "__main__":
    run(main)
