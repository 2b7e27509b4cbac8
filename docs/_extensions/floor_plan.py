"""The directives ``floor-plan``, the rooms of all packages as a picture, and ``rooms``, a table of one package's.

::

    ```{floor-plan}
    ```

    ```{rooms} deepmuon_runtime
    ```

Both are made from the code when the site is built, by `studies.pictures.floor_plan`.
"""

from __future__ import annotations

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective
from sphinx.util.typing import ExtensionMetadata

from studies.pictures.floor_plan import drawing, rooms
from studies.pictures.imports import modules

__all__ = ["setup"]


class FloorPlan(SphinxDirective):
    """The picture, as SVG in the page, so that it has the page's colours."""

    def run(self) -> list[nodes.Node]:
        """Draw it."""
        for path in modules().values():
            self.env.note_dependency(str(path))
        return [nodes.raw("", drawing(), format="html")]


class Rooms(SphinxDirective):
    """The table."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Make it."""
        lines = ["| room | what it is for | modules | stands on |", "|---|---|--:|---|"]
        for room in rooms(self.arguments[0]):
            purpose = " ".join(room.purpose.split())
            uses = ", ".join(f"`{name}`" for name in room.uses)
            lines.append(f"| `{room.name}` | {purpose} | {room.modules} | {uses} |")
        return self.parse_text_to_nodes("\n".join(lines))


def setup(app: Sphinx) -> ExtensionMetadata:
    """Add the directives."""
    app.add_directive("floor-plan", FloorPlan)
    app.add_directive("rooms", Rooms)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
