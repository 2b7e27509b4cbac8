"""Adds to what pyproject.toml says that deepmuon-training needs: the deepmuon-runtime of its own version."""

from __future__ import annotations

from typing import Any

from hatchling.metadata.plugin.interface import MetadataHookInterface


class Dependencies(MetadataHookInterface):
    """Runs where the package is built from a clone; a source distribution carries the result in its PKG-INFO."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Set the dependencies."""
        metadata["dependencies"] = [f"deepmuon-runtime=={metadata['version']}", *self.config["dependencies"]]
