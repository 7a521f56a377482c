"""Isoform carries shapes between point clouds, implicit functions, rational patches and meshes.

Points are arrays (n, 3) of float64 in the unit of their file; other numbers and lists are
converted. Calls that take time release the lock of the interpreter, stop at Ctrl-C, and give the
numbers of the program ``isoform`` to the last bit.
"""

from __future__ import annotations

from ._errors import IsoformError
from ._fit import FitResult, fit
from ._isoform import __version__
from ._model import Model, Parameter, template
from ._points import PointCloud, read_points

__all__ = [
    "FitResult",
    "IsoformError",
    "Model",
    "Parameter",
    "PointCloud",
    "__version__",
    "fit",
    "read_points",
    "template",
]

# They are of this package, wherever they are written.
for _name in __all__:
    if callable(globals()[_name]):
        globals()[_name].__module__ = __name__
del _name
