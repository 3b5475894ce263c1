"""Names that people gave to files and folders, shown as they are: no line break, escape code or formula of theirs."""


def literal(text: str) -> str:
    """A text with what no printer would print as an escape sequence, as Python writes it."""
    return "".join(one if one.isprintable() else one.encode("unicode_escape").decode() for one in text)


def in_figure(text: str) -> str:
    """A text for figures, which set what stands between dollars as a formula."""
    return literal(text).replace("$", r"\$")
