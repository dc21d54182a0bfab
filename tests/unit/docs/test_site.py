# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""The documentation site (mkdocs.yml, ./run docs), as far as it can be checked without mkdocs: its pages, and that it loads nothing from other
hosts."""

import json
import re
import unittest

import yaml

from srfs import ROOT
from srfs.site import github_markdown


class Loader(yaml.SafeLoader):
    """Loads the Python functions named in mkdocs.yml as texts."""


for prefix in ("tag:yaml.org,2002:python/name:", "tag:yaml.org,2002:python/object/apply:"):
    Loader.add_multi_constructor(prefix, lambda loader, suffix, node: suffix)

SITE = yaml.load((ROOT / "mkdocs.yml").read_text(), Loader)  # noqa: S506  (a SafeLoader)


def pages(nav):
    """Paths of the pages of a nav, in order."""
    for entry in nav:
        for target in entry.values() if isinstance(entry, dict) else [entry]:
            yield from pages(target) if isinstance(target, list) else [target]


NAV = list(pages(SITE["nav"]))


class Nav(unittest.TestCase):
    def test_every_page_exists_and_is_there_once(self):
        self.assertEqual([page for page in NAV if not (ROOT / page).is_file()], [])
        self.assertEqual(sorted(set(NAV)), sorted(NAV))

    def test_every_document_is_a_page(self):
        documents = {str(path.relative_to(ROOT)) for path in (ROOT / "docs").rglob("*.md")}
        self.assertIn("docs/README.md", documents)
        self.assertEqual(sorted(documents - set(NAV)), [])

    def test_what_the_reading_path_lists_is_a_page_in_the_same_order(self):
        lists = re.findall(r"^(?:- |\d+\. |  ).*$", (ROOT / "docs/README.md").read_text(), re.M)
        links = [str((ROOT / "docs" / link).resolve().relative_to(ROOT)) for link in re.findall(r"\]\(([^)#]+\.md)\)", "\n".join(lists))]
        self.assertGreater(len(links), 30)
        self.assertEqual([link for link in links if link not in NAV], [])
        self.assertEqual(links, sorted(links, key=NAV.index))


class OtherHosts(unittest.TestCase):
    def test_the_site_loads_nothing_from_them(self):
        self.assertIs(SITE["theme"]["font"], False)
        self.assertNotIn("repo_url", SITE)  # the theme would ask that host for the number of stars
        loaded = SITE["extra_javascript"] + SITE["extra_css"]
        self.assertEqual([path for path in loaded if re.match(r"[a-z]+:|//", path)], [])
        fences = next(entry for entry in SITE["markdown_extensions"] if isinstance(entry, dict) and "pymdownx.superfences" in entry)
        classes = [fence["class"] for fence in fences["pymdownx.superfences"]["custom_fences"]]
        self.assertNotIn("mermaid", classes)  # for that class, the theme's script loads Mermaid from another host

    def test_mermaid_is_pinned_by_version_and_hash(self):
        wanted = json.loads((ROOT / "tools/docs/package.json").read_text())["dependencies"]
        locked = json.loads((ROOT / "tools/docs/package-lock.json").read_text())["packages"]
        self.assertEqual(locked.pop("")["dependencies"], wanted)
        self.assertEqual({name.removeprefix("node_modules/"): package["version"] for name, package in locked.items()}, wanted)
        for package in locked.values():
            self.assertRegex(package["integrity"], r"^sha512-")
            self.assertNotIn("resolved", package)  # independent of the machine's registry


class GithubMarkdown(unittest.TestCase):
    def assert_becomes(self, source, expected):
        self.assertEqual(github_markdown.for_python_markdown(source), expected)

    def test_a_list_after_a_paragraph_begins_after_an_empty_line(self):
        self.assert_becomes("Text:\n- a\n- b\nlazy\n\nText", "Text:\n\n- a\n- b\n    lazy\n\nText")

    def test_content_of_items_stands_at_four_columns_a_level(self):
        self.assert_becomes("- a\n  more\n  - b\n    more\n- c\n\n  text\n- d", "- a\n    more\n    - b\n        more\n- c\n\n    text\n\n- d")
        self.assert_becomes("1. a\n   more\n10. b\n    more", "1. a\n    more\n10. b\n    more")

    def test_a_number_within_a_paragraph_is_no_list(self):
        self.assert_becomes("- ends with code\n  11. If\n- b", "- ends with code\n    11\\. If\n- b")
        self.assert_becomes("in the year\n1986. What", "in the year\n1986\\. What")

    def test_code_stays(self):
        for code in ("```\n- a\n  - b \\\n```", "    - a\n      - b\n\n      \\"):
            self.assert_becomes(f"Text\n\n{code}\n\nText", f"Text\n\n{code}\n\nText")
        self.assert_becomes("- a\n\n  ```yaml\n  - b\n    c: 1\n  ```\n- d", "- a\n\n    ```yaml\n    - b\n      c: 1\n    ```\n\n- d")

    def test_a_table_after_a_paragraph_begins_after_an_empty_line(self):
        self.assert_becomes("Text\n| a | b |\n|---|---|\n| 1 | 2 |", "Text\n\n| a | b |\n|---|---|\n| 1 | 2 |")

    def test_a_backslash_at_the_end_breaks_the_line(self):
        self.assert_becomes("a\\\nb", "a  \nb")


if __name__ == "__main__":
    unittest.main()
