# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Hooks of mkdocs (mkdocs.yml): the site has the documents of the tree at the paths that they have in the tree.

Pages are README.md, everything in docs/ and every Markdown file that one of them links to, wherever it lies; a linked file of
another kind is copied. So links and pictures need no change. ./run docs puts the API (doxygen) and Mermaid into build-docs/.
"""

import logging
import re
from pathlib import Path

from mkdocs.structure.files import File, Files
from mkdocs.structure.nav import Link

from srfs import ROOT
from srfs.site.github_markdown import for_python_markdown, outside_code

MADE = ROOT / "build-docs"
START = ("README.md", "docs/README.md")
TARGET = re.compile(r"\]\(([^)\s#]+)")
LOG = logging.getLogger("mkdocs.plugins.srfs")  # a warning fails a build with --strict


def on_config(config):
    """Without Mermaid (mkdocs called by hand in a fresh clone) the diagrams stay text."""
    config["extra_javascript"] = [path for path in config["extra_javascript"] if source_of(path).is_file()]
    return config


def on_files(files, config):
    docs = Path(config["docs_dir"])
    kept = [file for file in files if not Path(file.abs_src_path).is_relative_to(docs)]  # the theme's

    def of_site(path, folder=ROOT):
        return File(path, str(folder), config["site_dir"], config["use_directory_urls"])

    own = [of_site(path) for path in sorted(documents())]
    for path in config["extra_javascript"] + config["extra_css"]:
        own.append(of_site(path, ROOT if (ROOT / path).is_file() else MADE))
    for folder in ("api", "assets"):
        own += [of_site(str(p.relative_to(MADE)), MADE) for p in sorted((MADE / folder).rglob("*")) if p.is_file()]
    return Files(list({file.src_path: file for file in kept + own}.values()))


def on_nav(nav, config, files):
    if (MADE / "api/index.html").is_file():
        nav.items.append(Link("API", "api/index.html"))
    return nav


def on_page_markdown(markdown, page, config, files):
    folder = (ROOT / page.file.src_path).parent

    def readme_of_folder(link):
        path = link.group(1)
        if not (folder / path).is_dir() or re.match(r"[a-z]+:", path):
            return link.group(0)
        readme = f"{path.rstrip('/')}/README.md"
        if not (folder / readme).is_file():
            LOG.warning("'%s' links to the folder '%s', which has no README.md: name a file", page.file.src_path, path)
        return f"]({readme}"

    return for_python_markdown(outside_code(markdown, lambda line: TARGET.sub(readme_of_folder, line)))


def source_of(path):
    return ROOT / path if (ROOT / path).is_file() else MADE / path


def documents():
    """Paths below ROOT of all documents and of the files that they show or link to."""
    found, ahead = set(), [ROOT / path for path in START] + sorted((ROOT / "docs").rglob("*.md"))
    while ahead:
        document = ahead.pop()
        path = str(document.relative_to(ROOT))
        if path not in found:
            found.add(path)
            ahead += targets(document) if document.suffix == ".md" else []
    return found


def targets(document):
    """Files of the tree that a document links to; of a folder, its README.md."""
    lines = []
    outside_code(document.read_text(encoding="utf-8"), lines.append)
    for path in TARGET.findall("\n".join(lines)):
        target = (document.parent / path).resolve()
        target = target / "README.md" if target.is_dir() else target
        if target.is_file() and target.is_relative_to(ROOT):
            yield target
