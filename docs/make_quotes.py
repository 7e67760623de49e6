#!/usr/bin/env python3
"""Fills in the measured numbers that a page quotes from the table of another one, so that each is written down once.

    docs/make_quotes.py [--check]

A quote is `<!--PAGE: CELL; CELL; COLUMN-->number<!--/-->`: of the one row of PAGE.md that has those cells, what is
under COLUMN. What is behind the number in brackets, as in "4.12 (2.9x)", is left out; `COLUMN ()` is that alone. A
quote is never first in its line, where a comment would end the paragraph.

--check writes nothing and exits 1 with a sentence if a page is not what it would be.
"""

import re
import sys
from pathlib import Path

DOCS = Path(__file__).resolve().parent
QUOTE = re.compile(r"<!--([\w-]+): ([^>]+?)-->(.*?)<!--/-->", re.DOTALL)


def tables(text):
    """Yields (header, row) of each row of a page's tables, both lists of cells."""
    header = None
    for line in text.splitlines():
        cells = [cell.strip() for cell in line.strip("| ").replace("*", "").split("|")]
        if not line.startswith("|"):
            header = None
        elif header is None:
            header = cells
        elif not set(line) <= set("|- "):
            yield header, cells


def number(page, address):
    """Returns the text that stands there. Raises ValueError if it is not in exactly one place."""
    *wanted, column = (part.strip() for part in address.split(";"))
    in_brackets = column.endswith(" ()")
    column = column.removesuffix(" ()")
    found = [
        row[header.index(column)]
        for header, row in tables(QUOTE.sub(r"\3", (DOCS / f"{page}.md").read_text(encoding="utf-8")))
        if column in header and set(wanted) <= set(row)
    ]
    if len(found) != 1:
        raise ValueError(
            f"{page}.md has {len(found)} rows with {'; '.join(wanted)} and a column {column}; expected one"
        )
    main, bracket = re.fullmatch(r"([^(]*?)(?: \(([^)]*)\))?", found[0]).groups()
    return bracket if in_brackets else main


def filled(text):
    return QUOTE.sub(lambda match: f"<!--{match[1]}: {match[2]}-->{number(match[1], match[2])}<!--/-->", text)


def pages():
    return [DOCS.parent / "README.md", *sorted(DOCS.glob("*.md"))]


def check():
    """Returns what is wrong with the pages, a sentence, or None."""
    for page in pages():
        text = page.read_text(encoding="utf-8")
        if re.search(rf"^ *{QUOTE.pattern}", text, re.MULTILINE):
            return f"{page.name} has a quote at the beginning of a line: put a word before it"
        if filled(text) != text:
            return f"{page.name} quotes other numbers than were measured: run docs/{Path(__file__).name}"
    return None


def main(arguments):
    if "--check" in arguments:
        return check()
    for page in pages():
        text = page.read_text(encoding="utf-8")
        if filled(text) != text:
            page.write_text(filled(text), encoding="utf-8")
    return None


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
