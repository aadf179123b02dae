"""The page's legend as HTML: colours of the drawing, and keys."""

_DRAWN = (
    ("#f03060", "⤢", "arrows, rings", "drag them: the hand follows"),
    ("#1ea050", "─", "thin green line", "from the hand to where it is dragged"),
    ("#141414", "━", "black path", "last demonstration; grey: earlier ones"),
    ("#1ea050", "━", "green path", "prediction, without obstacles"),
    ("#73bff2", "■", "pale hand", "playback of the demonstration"),
    ("#1e5ae6", "━", "blue path", "the hand while it reaches"),
    ("#aa32c8", "━", "violet path", "the hand since the goal moved"),
    ("#e04020", "●", "dots", "obstacles seen; red: near the hand"),
    ("#e6321e", "➜", "red arrow", "coupling: the push of the obstacles"),
)
_KEYS = (
    ("R, Space", "record, stop"),
    ("L, G", "learn, reach"),
    ("U, S", "undo, save"),
    ("arrows, PgUp, PgDn", "move the hand as you see it"),
    ("Z X, C V, B N", "turn the hand: roll, pitch, yaw"),
)
_CELL = "style='padding:1px 6px 1px 0;vertical-align:top'"


def _row(*cells: str) -> str:
    return "<tr>" + "".join(f"<td {_CELL}>{cell}</td>" for cell in cells) + "</tr>"


LEGEND = (
    "<div style='font-size:0.82em;padding:0.3em 0.7em;line-height:1.4'><table>"
    + "".join(
        _row(
            f"<span style='color:{color}'><b>{sign}</b></span>",
            f"<b style='white-space:nowrap'>{name}</b>",
            meaning,
        )
        for color, sign, name, meaning in _DRAWN
    )
    + "</table><p style='margin:0.6em 0'>Drag the goal and the obstacles themselves with the mouse."
    " Drag beside them to turn the view; the wheel zooms.</p><table>"
    + "".join(_row(f"<b>{keys}</b>", meaning) for keys, meaning in _KEYS)
    + "</table><p style='margin:0.6em 0'>A game pad leads the hand, too.</p></div>"
)
"""For viser's `add_html`; contains no external text."""
