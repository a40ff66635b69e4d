"""Draws enormous meshes and scans into NumPy arrays.

>>> import surfel
>>> model = surfel.open("generate:sphere:1000")
>>> picture = model.render(model.orbit(30, 20), depth=True)
>>> picture.color.shape, picture.depth.shape
((500, 500, 3), (500, 500))
"""

from ._surfel import (
    Camera,
    DeviceError,
    Error,
    InputError,
    Model,
    Picture,
    Renderer,
    __version__,
    compare,
    devices,
    open,
)

__all__ = [
    "Camera",
    "DeviceError",
    "Error",
    "InputError",
    "Model",
    "Picture",
    "Renderer",
    "__version__",
    "compare",
    "devices",
    "open",
]
