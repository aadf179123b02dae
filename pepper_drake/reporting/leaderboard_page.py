"""The benchmark as one self-contained page: outcomes of the methods, and failures."""

import base64
from collections.abc import Mapping, Sequence
from html import escape

from pepper_drake.benchmarking.method_result import MethodResult
from pepper_drake.benchmarking.methods import get_method
from pepper_drake.benchmarking.summary import HEADER, MethodSummary, Scenes, table_rows
from pepper_drake.reporting.benchmark_figure import COLORS

_STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; margin: 2rem auto; max-width: 1500px;
  padding: 0 1rem; color: #222; background: #fff; }
table { border-collapse: collapse; margin: 1rem 0; font-variant-numeric: tabular-nums; }
th, td { padding: 0.35rem 0.6rem; border-bottom: 1px solid #ddd; text-align: right;
  vertical-align: top; }
th { background: #f4f4f2; font-weight: 600; }
th:first-child, td:first-child { text-align: left; }
.scroll { overflow-x: auto; }
.dot { display: inline-block; width: 0.9em; height: 0.9em; border-radius: 50%; margin-right: 0.4em;
  vertical-align: -0.1em; }
.grid td, .grid th { text-align: left; font-size: 13px; }
img { max-width: 100%; }
.failure { display: grid; grid-template-columns: 320px 1fr; gap: 1rem; margin: 1.2rem 0;
  align-items: start; }
.failure ul { margin: 0.2rem 0; padding-left: 1.2rem; }
@media (max-width: 700px) { .failure { grid-template-columns: 1fr; } }
"""


def leaderboard_page(
    summaries: Sequence[MethodSummary],
    results: Sequence[MethodResult],
    figure: bytes,
    *,
    pictures: Mapping[str, bytes],
    recordings: Mapping[tuple[str, str], str],
) -> str:
    """Returns the page as HTML.

    Args:
        summaries: Summaries from `summarise`.
        results: The summarised results.
        figure: PNG of `draw_benchmark`.
        pictures: PNG of the scene, by case.
        recordings: Address of a run's recording, relative to the page, by case and method.
    """
    scenes = Scenes.of(results)
    ranked = sorted(summaries, key=lambda summary: -summary.rates["reached"].count)
    rows = table_rows(ranked)
    failures = [result for result in results if result.outcome != "reached"]
    return "\n".join(
        (
            '<!DOCTYPE html><html lang="en"><head><meta charset="utf-8">',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            f"<title>Reaching benchmark</title><style>{_STYLE}</style></head><body>",
            "<h1>Reaching benchmark</h1>",
            f"<p>{escape(str(scenes))} Rates are of {scenes.share}, with 95 % confidence after "
            "Wilson; times, lengths, jerk and clearance are medians over the runs that reached. "
            "</p>",
            '<div class="scroll"><table>',
            _row("th", HEADER),
            *(_row("td", row) for row in rows),
            "</table></div>",
            f"<ul>{''.join(_about(summary) for summary in ranked)}</ul>",
            f'<p><img alt="Outcomes and spreads of each method" src="{_inline(figure)}"></p>',
            "<h2>Every run</h2>",
            '<div class="scroll"><table class="grid">',
            *_grid(ranked, results),
            "</table></div>",
            f"<h2>What failed: {len(failures)} of {len(results)} runs</h2>",
            *(
                _failure(case, [f for f in failures if f.case == case], pictures, recordings)
                for case in dict.fromkeys(f.case for f in failures)
            ),
            "</body></html>",
            "",
        )
    )


def _row(tag: str, cells: Sequence[str]) -> str:
    return f"<tr>{''.join(f'<{tag}>{escape(cell)}</{tag}>' for cell in cells)}</tr>"


def _about(summary: MethodSummary) -> str:
    method = get_method(summary.method)
    return f"<li><b>{escape(method.label)}</b>: {escape(method.description)}</li>"


def _dot(outcome: str) -> str:
    return f'<span class="dot" style="background:{COLORS[outcome]}"></span>{outcome}'


def _grid(summaries: Sequence[MethodSummary], results: Sequence[MethodResult]) -> list[str]:
    """Returns a row for each scene, with a cell for each method."""
    outcomes = {(result.case, result.method): result.outcome for result in results}
    letters = [summary.method for summary in summaries]
    lines = [_row("th", ["scene", *(get_method(letter).label for letter in letters)])]
    for case in dict.fromkeys(result.case for result in results):
        cells = [
            f"<td>{_dot(outcomes[case, k]) if (case, k) in outcomes else ''}</td>" for k in letters
        ]
        lines.append(f"<tr><td>{escape(case)}</td>{''.join(cells)}</tr>")
    return lines


def _failure(
    case: str,
    failures: Sequence[MethodResult],
    pictures: Mapping[str, bytes],
    recordings: Mapping[tuple[str, str], str],
) -> str:
    """Returns a scene's picture with the messages of the methods that failed."""
    picture = pictures.get(case)
    image = f'<img alt="{escape(case)}" src="{_inline(picture)}">' if picture else "<span></span>"
    items = []
    for failure in failures:
        address = recordings.get((case, failure.method))
        link = f' <a href="{escape(address)}">recording</a>' if address else ""
        text = failure.message or failure.closest_pair
        label = escape(get_method(failure.method).label)
        message = f": {escape(text)}" if text else ""
        items.append(f"<li>{_dot(failure.outcome)} <b>{label}</b>{message}{link}</li>")
    name = f"<h3>{escape(case)}</h3>"
    return f'<div class="failure">{image}<div>{name}<ul>{"".join(items)}</ul></div></div>'


def _inline(png: bytes) -> str:
    return f"data:image/png;base64,{base64.b64encode(png).decode()}"
