"""Base classes of results: their document, and their display in notebooks."""

from __future__ import annotations

import json
from typing import Any


class Documented:
    """Result with the document that the program prints for it."""

    _document: str

    def to_dict(self) -> dict[str, Any]:
        """Return the document that the program ``isoform`` prints with ``--json``.

        Returns
        -------
        dict
            The document in plain types.
        """
        return json.loads(self._document)  # type: ignore[no-any-return]


class Shown:
    """Result that a notebook displays as an interactive page."""

    def _repr_html_(self) -> str:
        from ._verbs import view

        return view(self)._repr_html_()
