"""The directive ``include-all``: every Markdown file that matches a pattern, or one section of each.

::

    ```{include-all} ../models/deepmuon_models/*.md
    :section: Scores
    :pictures: evaluations
    ```

The pattern is relative to the page. A file begins with its title; with ``section`` the title stays and of what
follows only the section with that heading. With ``pictures``, after NAME.md come those in that folder's NAME/.
Pictures that a file shows itself are found beside it. No match is no error.
With ``folded``, each file is a line that opens at a click, and its headings are none of the page's.
"""

from __future__ import annotations

import os
import re
from html import escape
from pathlib import Path
from typing import ClassVar

from docutils import nodes
from docutils.parsers.rst import directives
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective
from sphinx.util.typing import ExtensionMetadata

__all__ = ["setup"]

PICTURE = re.compile(r"(!\[[^]]*\]\()([\w./-]+\.(?:png|svg)\))")


class IncludeAll(SphinxDirective):
    """The directive."""

    required_arguments = 1
    option_spec: ClassVar = {
        "section": directives.unchanged_required,
        "pictures": directives.unchanged_required,
        "folded": directives.flag,
    }

    def run(self) -> list[nodes.Node]:
        """Parse the files as sections of the page."""
        folder = Path(self.env.doc2path(self.env.docname)).parent
        found: list[nodes.Node] = []
        for file in sorted(folder.glob(self.arguments[0])):
            self.env.note_dependency(str(file))
            beside = Path(os.path.relpath(file.parent, folder)).as_posix()
            shown = PICTURE.sub(rf"\g<1>{beside}/\g<2>", self.text(file))
            text = "\n\n".join([shown, *self.pictures(folder, file.stem)])
            if "folded" in self.options:
                found += _folded(self.parse_text_to_nodes(text))  # where headings are no sections
            else:
                found += self.parse_text_to_nodes(text, allow_section_headings=True)
        return found

    def text(self, file: Path) -> str:
        """Return the file, or its title and the wanted section, two levels of headings deeper."""
        title, *sections = file.read_text(encoding="utf-8").split("\n## ")
        wanted = self.options.get("section")
        if wanted is None:
            return "\n#### ".join([f"##{title}", *sections])
        bodies = [body for heading, _, body in (section.partition("\n") for section in sections) if heading == wanted]
        return "\n".join([f"##{title.splitlines()[0]}", *bodies])

    def pictures(self, folder: Path, name: str) -> list[str]:
        """Return the pictures that belong to a file, in Markdown."""
        if "pictures" not in self.options:
            return []
        pictures = sorted((folder / self.options["pictures"] / name).glob("*.png"))
        shown = [f"![{_alt(picture.stem, name)}]({picture.relative_to(folder).as_posix()})" for picture in pictures]
        return ["\n".join(shown)] if shown else []


def _folded(parsed: list[nodes.Node]) -> list[nodes.Node]:
    """Return a text, the first of whose nodes is its title, as one that opens at a click on that."""
    title, *rest = parsed
    name = title.astext()
    start = f'<details class="card" id="{nodes.make_id(name)}"><summary>{escape(name)}</summary>'
    return [nodes.raw("", start, format="html"), *rest, nodes.raw("", "</details>", format="html")]


def _alt(quantity: str, name: str) -> str:
    return f"{quantity} of {name}: generated and held-out muons, and their ratio"


def setup(app: Sphinx) -> ExtensionMetadata:
    """Add the directive."""
    app.add_directive("include-all", IncludeAll)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
