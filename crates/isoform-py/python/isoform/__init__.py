"""Isoform converts shapes between point clouds, implicit functions, rational patches and meshes.

Points are arrays (n, 3) of float64 in the unit of their file; other numbers and lists are
converted. Long calls release the lock of the interpreter and stop at Ctrl-C. Results are identical
to those of the program ``isoform``, to the last bit.

>>> import isoform, numpy as np
>>> ball = isoform.template("sphere")
>>> mesh = isoform.mesh(ball, size=0.25, surface_only=True, params={"radius": 1})
>>> result = isoform.fit(mesh.points, ball)
>>> round(result.values["radius"], 6)
1.0
>>> isoform.compare(mesh.points, result.model).first_to_second["max"] < 1e-6
True
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ._errors import IsoformError, UncertifiedWarning
from ._isoform import __version__
from ._mesh import Mesh, Triangles
from ._model import Model, Parameter, template, templates
from ._points import PointCloud, read_points
from ._results import (
    Brep,
    Comparison,
    FitResult,
    Implicit,
    Patch,
    Patches,
    Picture,
    Recognition,
    Report,
    Triangulation,
    View,
)
from ._sample import sample
from ._verbs import (
    brep,
    compare,
    convert,
    evaluate,
    fit,
    functions,
    implicitize,
    inspect,
    mesh,
    parameterize,
    recognize,
    recover,
    render,
    triangulate,
    view,
)

if TYPE_CHECKING:
    from . import distributed as distributed

__all__ = [
    "Brep",
    "Comparison",
    "FitResult",
    "Implicit",
    "IsoformError",
    "Mesh",
    "Model",
    "Parameter",
    "Patch",
    "Patches",
    "Picture",
    "PointCloud",
    "Recognition",
    "Report",
    "Triangles",
    "Triangulation",
    "UncertifiedWarning",
    "View",
    "__version__",
    "brep",
    "compare",
    "convert",
    "distributed",
    "evaluate",
    "fit",
    "functions",
    "implicitize",
    "inspect",
    "mesh",
    "parameterize",
    "read_points",
    "recognize",
    "recover",
    "render",
    "sample",
    "template",
    "templates",
    "triangulate",
    "view",
]

# Public names belong to this package, whichever module defines them.
for _name in __all__:
    if callable(globals().get(_name)):
        globals()[_name].__module__ = __name__
del _name


def __getattr__(name: str) -> Any:
    """Import rarely used modules on first access."""
    if name == "distributed":
        import importlib

        return importlib.import_module("isoform.distributed")
    raise AttributeError(f"module 'isoform' has no attribute {name!r}")
