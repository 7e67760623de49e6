"""Converts the manual's pages (docs/*.md) to HTML for the add-on's zip, so that users can read the manual of exactly
the installed version without a network."""

import re
import sys

import markdown

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
@media (prefers-color-scheme: dark) {{
  body {{ color: #d8dadd; background: #1d1f21; }} code, pre {{ background: #2a2d30; }}
  th, td {{ border-color: #44484c; }} a {{ color: #7db4f0; }} }}
</style></head><body>
{body}
</body></html>
"""


def pages(docs):
    """Returns {file name: bytes}: a page for each .md file of the folder, the pictures that the pages show, and job
    descriptions for render farms."""
    files = {}
    for path in docs.glob("*.md"):
        text = path.read_text(encoding="utf-8")
        body = markdown.markdown(text, extensions=["extra", "toc", "sane_lists"])
        body = re.sub(r'href="([\w-]+)\.md(#[^"]*)?"', r'href="\1.html\2"', body)
        title = re.search(r"^# (.+)$", text, re.MULTILINE)[1]
        files[f"{path.stem}.html"] = PAGE.format(title=title, body=body).encode()
        for picture in re.findall(r'<img [^>]*src="([\w.-]+)"', body):
            if not (docs / picture).is_file():
                sys.exit(f"manual.py: {path.name} shows {picture}, which does not exist")
            files[picture] = (docs / picture).read_bytes()
    return files | {f"farm/{path.name}": path.read_bytes() for path in (docs / "farm").iterdir()}
