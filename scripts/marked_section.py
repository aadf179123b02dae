"""Replacement of a document's section between two marks."""


def with_section(document: str, begin: str, end: str, text: str) -> str:
    """Returns a document with the section between its marks replaced.

    Args:
        document: Text with both marks.
        begin: Line before the section.
        end: Line after it.
        text: New section.
    """
    before, first, rest = document.partition(begin)
    _, last, after = rest.partition(end)
    if not first or not last:
        raise SystemExit(f"the document lacks {begin.strip()} or {end.strip()}; put both back")
    return f"{before}{begin}{text}{end}{after}"
