"""Motions beside one another, in figures."""

from collections.abc import Sequence

from pepper_drake.playback.motion import Motion

_DECIMALS = {"mm": 1, "deg": 1}


def compare(motions: Sequence[Motion]) -> dict[str, list[str]]:
    """Returns what there is to say of motions.

    Returns:
        By the name of a figure a text for each motion, empty where the motion has no such figure;
        names in the order in which motions bring them.
    """
    names = dict.fromkeys(name for motion in motions for name in motion.figures)
    rows = {
        name: [_text(name, motion.figures.get(name, "")) for motion in motions] for name in names
    }
    return {name: texts for name, texts in rows.items() if any(texts)}


def _text(name: str, value: str | float) -> str:
    if isinstance(value, str):
        return value
    unit = name.partition("[")[2].rstrip("]")
    return f"{value:.{_DECIMALS.get(unit, 2)}f}"


def table(motions: Sequence[Motion]) -> str:
    """Returns the comparison as lines for a terminal: a column for each motion."""
    rows = {"": [motion.name for motion in motions], **compare(motions)}
    first = max(len(name) for name in rows)
    widths = [max(len(texts[k]) for texts in rows.values()) for k in range(len(motions))]
    return "\n".join(
        "  ".join(
            (
                f"  {name:{first}}",
                *(f"{text:>{width}}" for text, width in zip(texts, widths, strict=True)),
            )
        ).rstrip()
        for name, texts in rows.items()
    )
