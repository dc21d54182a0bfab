#!/usr/bin/python3
# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Checks a built site: every link of its pages leads to a file and an anchor that exist, and no page loads anything from another host.

python3 -m srfs.site.check FOLDER
"""

import argparse
import re
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

# (tag, attribute) that a browser loads without a click; of link, only where rel says so.
LOADED = {("script", "src"), ("img", "src"), ("iframe", "src"), ("source", "src"), ("video", "src"), ("object", "data"), ("embed", "src")}
LOADING_RELATIONS = {"stylesheet", "icon", "preload", "prefetch", "preconnect", "dns-prefetch", "manifest", "modulepreload"}
STYLE_URL = re.compile(r"""(?:@import\s+|url\(\s*)["']?([^"')\s]+)""")


class Page(HTMLParser):
    def __init__(self, path):
        super().__init__()
        self.anchors, self.links, self.loads, self.classes = set(), [], [], set()
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attributes):
        values = {name: value or "" for name, value in attributes}
        self.anchors |= {values[name] for name in ("id", "name") if name in values}
        self.classes |= set(values.get("class", "").split())
        for name, value in values.items():
            if (tag, name) in LOADED or (tag == "link" and name == "href" and LOADING_RELATIONS & set(values.get("rel", "").split())):
                self.loads.append(value)
            elif (tag, name) == ("a", "href"):
                self.links.append(value)


def target_of(site, page, url):
    """The file that a local address means; None: another host, or nothing to look up."""
    parts = urlsplit(url)
    if parts.scheme or parts.netloc or not (parts.path or parts.fragment):
        return None
    path = unquote(parts.path)
    file = page if not path else site / path.lstrip("/") if path.startswith("/") else page.parent / path
    file = file / "index.html" if file.is_dir() else file
    return file.resolve(), unquote(parts.fragment)


def complaints(site):
    pages = {path.resolve(): Page(path) for path in sorted(site.rglob("*.html"))}
    if not pages:
        yield f"{site} has no page"
    for path, page in pages.items():
        name = path.relative_to(site)
        for url in page.loads:
            if re.match(r"(?!data:|javascript:)[a-z]+:|//", url):
                yield f"{name} loads {url}"
        if "mermaid" in page.classes:
            yield f"{name} has an element of class mermaid, for which the theme's script loads Mermaid from another host"
        for url in page.links + page.loads:
            target = target_of(site, path, url)
            if target is None:
                continue
            file, anchor = target
            if not file.exists():
                yield f"{name}: {url} does not exist"
            elif anchor and file in pages and name.parts[0] != "api" and anchor not in pages[file].anchors:  # doxygen forgets some anchors of its own
                yield f"{name}: {url}: the page has no such anchor"
    for style in site.rglob("*.css"):
        for url in STYLE_URL.findall(style.read_text(encoding="utf-8", errors="replace")):
            if re.match(r"https?:|//", url):
                yield f"{style.relative_to(site)} loads {url}"


def main():
    parser = argparse.ArgumentParser(description="Checks links and anchors of a built site, and that it loads nothing from another host.")
    parser.add_argument("site", type=Path)
    site = parser.parse_args().site.resolve()
    found = list(complaints(site))
    for complaint in found:
        print(complaint, file=sys.stderr)
    print(f"{site}: {len(list(site.rglob('*.html')))} pages, {len(found)} problems")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
