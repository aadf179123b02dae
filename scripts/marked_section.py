"""The part of a document between two marks, which a script writes anew."""


def with_section(document: str, begin: str, end: str, text: str) -> str:
    """Returns a document with what stands between its marks replaced.

    Args:
        document: The whole text.
        begin: Line before the part.
        end: Line after it.
        text: The part.
    """
    before, first, rest = document.partition(begin)
    _, last, after = rest.partition(end)
    if not first or not last:
        raise SystemExit(f"the document lacks {begin.strip()} or {end.strip()}; put both back")
    return f"{before}{begin}{text}{end}{after}"
