"""The page's legend as HTML: colours of the drawing, and keys."""

_DRAWN = (
    ("#f03060", "⤢", "arrows, rings", "drag them: the hand follows"),
    ("#1ea050", "─", "thin green line", "from the hand to where it is dragged"),
    ("#141414", "━", "black path", "the last demonstration; those before it are grey"),
    ("#1ea050", "━", "green path", "prediction: what was learned, to the goal, without obstacles"),
    ("#73bff2", "■", "pale hand", "ghost: the demonstration that is played back"),
    ("#1e5ae6", "━", "blue path", "the hand while it reaches"),
    ("#aa32c8", "━", "violet path", "its path since the goal moved"),
    ("#e04020", "●", "dots", "obstacles as Pepper sees them: red is near the hand, blue is far"),
    ("#e6321e", "➜", "red arrow", "coupling: how the obstacles push the hand"),
)
_KEYS = (
    ("R, Space", "record, stop"),
    ("L, G", "learn, reach"),
    ("U, S", "undo, save"),
    ("arrows, PgUp, PgDn", "move the hand as you see it"),
    ("Z X, C V, B N", "turn the hand: roll, pitch, yaw"),
)
_CELL = "style='padding:1px 8px 1px 0;vertical-align:top'"


def _row(*cells: str) -> str:
    return "<tr>" + "".join(f"<td {_CELL}>{cell}</td>" for cell in cells) + "</tr>"


LEGEND = (
    "<div style='font-size:0.85em;padding:0.3em 0.7em;line-height:1.45'><table>"
    + "".join(
        _row(f"<span style='color:{color}'><b>{sign}</b></span>", f"<b>{name}</b>", meaning)
        for color, sign, name, meaning in _DRAWN
    )
    + "</table><p style='margin:0.6em 0'>Drag the goal and the obstacles themselves with the mouse."
    " Drag beside them to turn the view; the wheel zooms.</p><table>"
    + "".join(_row(f"<b>{keys}</b>", meaning) for keys, meaning in _KEYS)
    + "</table><p style='margin:0.6em 0'>A game pad leads the hand, too.</p></div>"
)
"""For viser's `add_html`; contains no external text."""
