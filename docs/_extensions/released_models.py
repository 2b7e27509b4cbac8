"""The directive ``released-models``: a table of the models that come with the package, from their manifest."""

from __future__ import annotations

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective
from sphinx.util.typing import ExtensionMetadata

from deepmuon_runtime import Model, RefusedError, list_models

__all__ = ["setup"]


class ReleasedModels(SphinxDirective):
    """The directive; without models the table is empty."""

    def run(self) -> list[nodes.Node]:
        """Make the table."""
        try:
            models = list_models()
        except RefusedError:
            models = []
        head = "| architecture | flux | medium | depth | rate / (m² s) | muons a draw | file | size |"
        return self.parse_text_to_nodes("\n".join([head, "|---|---|---|--:|--:|--:|---|--:|", *map(_row, models)]))


def _row(model: Model) -> str:
    rate, uncertainty = model.rate_hz_per_m2, model.rate_uncertainty_hz_per_m2
    unknown = "of the depth" if model.is_family else "unknown"
    texts = [f"{rate:.2f}" if rate else unknown, f" ± {uncertainty:.2f}" if uncertainty else ""]
    cells = [
        *(model.architecture, model.flux, model.medium, f"{model.depths} m", "".join(texts)),
        *(str(model.muons_per_draw), f"`{model.name}`", f"{model.size / 1e3:.0f} kB"),
    ]
    return f"| {' | '.join(cells)} |"


def setup(app: Sphinx) -> ExtensionMetadata:
    """Add the directive."""
    app.add_directive("released-models", ReleasedModels)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
