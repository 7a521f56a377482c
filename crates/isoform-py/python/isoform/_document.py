"""What results have in common: their document, and a picture in notebooks."""

from __future__ import annotations

import json
from typing import Any


class Documented:
    """A result with the document that the program prints of it."""

    _document: str

    def to_dict(self) -> dict[str, Any]:
        """Give the document that the program ``isoform`` prints with ``--json``.

        Returns
        -------
        dict
            Of plain types.
        """
        return json.loads(self._document)  # type: ignore[no-any-return]


class Shown:
    """What a notebook shows as a page."""

    def _repr_html_(self) -> str:
        from ._verbs import view

        return view(self)._repr_html_()
