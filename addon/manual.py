"""Converts the manual's pages (docs/*.md) to HTML with a search. They are in the add-on's zip, so that users can read
the manual of exactly the installed version without a network, and any web server can serve them.

    manual.py FOLDER

Writes the pages into a folder; they begin with index.html."""

import html
import json
import re
import sys
from pathlib import Path

import markdown

HERE = Path(__file__).parent

PAGE = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>{title}</title>
<meta name="viewport" content="width=device-width, initial-scale=1">
<style>
body {{ max-width: 46rem; margin: 2rem auto; padding: 0 1rem; font: 16px/1.55 system-ui, sans-serif;
  color: #24292e; background: #fff; }}
img {{ max-width: 100%; border-radius: 4px; }}
code {{ font: 14px ui-monospace, monospace; background: #f2f3f5; padding: 0.1em 0.25em; border-radius: 3px; }}
pre {{ background: #f2f3f5; padding: 0.8rem; overflow-x: auto; border-radius: 4px; }}
pre code {{ padding: 0; }}
table {{ border-collapse: collapse; }}
th, td {{ border: 1px solid #d5d8dc; padding: 0.3em 0.6em; text-align: left; vertical-align: top; }}
a {{ color: #1a5fb4; }}
nav {{ display: flex; gap: 1rem; align-items: baseline; }}
nav input {{ flex: 1; font: inherit; padding: 0.2em 0.5em; }}
#found span {{ color: #6a737d; font-size: 14px; }}
@media (prefers-color-scheme: dark) {{
  body {{ color: #d8dadd; background: #1d1f21; }} code, pre {{ background: #2a2d30; }}
  th, td {{ border-color: #44484c; }} a {{ color: #7db4f0; }} }}
</style></head><body>
<nav><a href="README.html">Sinew</a><input id="search" type="search" placeholder="Search the manual ( / )"></nav>
<ul id="found"></ul>
{body}
<script src="search_index.js"></script><script src="search.js"></script>
</body></html>
"""


def pages(docs):
    """Returns {file name: bytes}: a page for each .md file of the folder, the pictures that the pages show, what their
    search needs, job descriptions for render farms, and names of bones. index.html is README.html."""
    files, index = {}, []
    for path in sorted(docs.glob("*.md")):
        text = path.read_text(encoding="utf-8")
        body = markdown.markdown(text, extensions=["extra", "toc", "sane_lists"])
        body = re.sub(r'href="([\w-]+)\.md(#[^"]*)?"', r'href="\1.html\2"', body)
        title = re.search(r"^# (.+)$", text, re.MULTILINE)[1]
        index += sections(f"{path.stem}.html", title, body)
        files[f"{path.stem}.html"] = PAGE.format(title=title, body=body).encode()
        for picture in re.findall(r'<img [^>]*src="([\w.-]+)"', body):
            if not (docs / picture).is_file():
                sys.exit(f"manual.py: {path.name} shows {picture}, which does not exist")
            files[picture] = (docs / picture).read_bytes()
    files["index.html"] = files["README.html"]
    files["search.js"] = (HERE / "search.js").read_bytes()
    files["search_index.js"] = f"const INDEX = {json.dumps(index, ensure_ascii=False)};\n".encode()
    beside = (path for folder in ("bone-names", "farm") for path in sorted((docs / folder).iterdir()))
    return files | {path.relative_to(docs).as_posix(): path.read_bytes() for path in beside}


def sections(page, title, body):
    """Returns [page, anchor, heading, text] for each heading of a page's HTML."""
    found = []
    for part in re.split(r"(?=<h[1-4] id=)", body):
        heading = re.match(r'<h\d id="([^"]*)">(.*?)</h\d>(.*)', part, re.DOTALL)
        if heading:
            anchor, name, text = heading[1], *(plain(each) for each in heading.groups()[1:])
            found.append([page, anchor, name if name == title else f"{title}: {name}", text])
    return found


def plain(text):
    """Returns the words of HTML."""
    return " ".join(html.unescape(re.sub(r"<!--.*?-->|<[^>]*>", " ", text, flags=re.DOTALL)).split())


def main(arguments):
    if len(arguments) != 1:
        sys.exit(__doc__)
    folder = Path(arguments[0])
    for name, data in pages(HERE.parent / "docs").items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
    print(folder / "index.html")


if __name__ == "__main__":
    main(sys.argv[1:])
