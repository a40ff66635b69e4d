from collections.abc import Sequence
from os import PathLike
from typing import Literal, TypedDict, Unpack, final, type_check_only

import numpy as np
from numpy.typing import NDArray

__version__: str

_Vector = tuple[float, float, float]
# Three numbers: a tuple, a list or an array.
_Triple = Sequence[float] | NDArray[np.floating]
_Size = tuple[int, int]
_Backend = Literal["auto", "vulkan", "cpu", "reference"]

class Error(Exception):
    """Anything that surfel refuses or that fails. A file that is not there is FileNotFoundError."""

class InputError(Error):
    """A file, a value or an option is wrong."""

class DeviceError(Error):
    """The device or the system failed."""

@type_check_only
class Look(TypedDict, total=False):
    """Options of a picture, as `surfel render` has them.

    They are those of commands that measure. Without any the light is the headlight and nothing is darkened.
    """

    method: Literal["triangles", "points", "splats", "pop"]
    splat: Literal["square", "disc", "ellipse", "gauss", "visibility", "filtered"]
    threshold: float
    blend: Literal["opaque", "two-pass", "depth-threshold", "depth-range"]
    shading: Literal["per-splat", "deferred"]
    reconstruct: Literal["gaussian", "density", "pull-push"]
    path: Literal["auto", "raster", "compute"]
    occlusion: Literal["auto", "on", "off"]
    culling: Literal["auto", "on", "off"]
    eye_dome: Literal["auto", "on", "off"]
    eye_dome_strength: float
    color_by: Literal[
        "shading", "primitive", "classification", "level", "normal", "depth", "overdraw"
    ]
    size_metric: Literal["exact", "center", "nearest", "angle", "area"]
    depth_offset: float
    background: tuple[int, int, int]
    light: Literal["headlight", "studio", "clay", "porcelain", "metal"]
    light_at: tuple[float, float]
    ambient_occlusion: Literal["auto", "on", "off"]
    one_sided: bool
    colors: bool

@type_check_only
class Statistics(TypedDict):
    """Counts of the cut and what was drawn; times in milliseconds."""

    nodes_visited: int
    hidden: int
    between: int
    splats: int
    triangles: int
    points: int
    draw_list_bytes: int
    frame_ms: float
    cut_ms: float
    pack_ms: float

@type_check_only
class Comparison(TypedDict, total=False):
    """Differences of two pictures. The keys from object_psnr on are there where both have coverage."""

    flip: float
    psnr: float
    ssim: float
    max_level: float
    mean_level: float
    pixels_past_a_level: int
    object_psnr: float
    object_pixels: int
    missing: int
    extra: int
    hole_pixels: int
    silhouette_iou: float
    flip_map: NDArray[np.float32]

@final
class Camera:
    """A camera: the size of its picture and where it looks, in the coordinates of the file."""

    @staticmethod
    def look_at(
        eye: _Triple,
        target: _Triple,
        *,
        up: _Triple | None = None,
        fov: float = 45.0,
        near: float | None = None,
        far: float | None = None,
        size: _Size = ...,
    ) -> Camera: ...
    @staticmethod
    def read(path: str | PathLike[str]) -> Camera: ...
    @staticmethod
    def from_json(text: str) -> Camera: ...
    def to_json(self) -> str: ...
    def resized(self, size: _Size) -> Camera: ...
    @property
    def size(self) -> _Size: ...
    @property
    def view(self) -> NDArray[np.float64]: ...
    @property
    def projection(self) -> NDArray[np.float64]: ...
    @property
    def eye(self) -> _Vector: ...

@final
class Picture:
    """A picture, row 0 on top."""

    @property
    def color(self) -> NDArray[np.uint8]: ...
    @property
    def values(self) -> NDArray[np.float32]: ...
    @property
    def coverage(self) -> NDArray[np.float32]: ...
    @property
    def depth(self) -> NDArray[np.float32] | None: ...
    @property
    def normals(self) -> NDArray[np.float32] | None: ...
    @property
    def statistics(self) -> Statistics: ...
    @property
    def size(self) -> _Size: ...
    def save(self, path: str | PathLike[str]) -> None: ...

@final
class Model:
    """A model that was opened."""

    @property
    def name(self) -> str: ...
    @property
    def format(self) -> str: ...
    @property
    def kind(self) -> Literal["surface", "points", "empty"]: ...
    @property
    def vertex_count(self) -> int: ...
    @property
    def triangle_count(self) -> int: ...
    @property
    def node_count(self) -> int: ...
    @property
    def bounds(self) -> tuple[_Vector, _Vector]: ...
    @property
    def center(self) -> _Vector: ...
    @property
    def radius(self) -> float: ...
    @property
    def up(self) -> Literal["x", "y", "z"]: ...
    @property
    def is_closed(self) -> bool: ...
    @property
    def has_colors(self) -> bool: ...
    @property
    def warnings(self) -> list[str]: ...
    @property
    def memory_bytes(self) -> int: ...
    @property
    def scene_camera(self) -> Camera | None: ...
    def orbit(
        self,
        azimuth: float = 30.0,
        elevation: float = 20.0,
        fill: float = 1.0,
        *,
        up: Literal["auto", "x", "y", "z"] = "auto",
        size: _Size = ...,
    ) -> Camera: ...
    def render(
        self,
        camera: Camera | None = None,
        *,
        samples: int = 1,
        depth: bool = False,
        normals: bool = False,
        backend: _Backend = "auto",
        device: str | int | None = None,
        validate: bool = False,
        **look: Unpack[Look],
    ) -> Picture: ...

@final
class Renderer:
    """Draws pictures of one model in one size; faster than Model.render for several."""

    def __new__(
        cls,
        model: Model,
        size: _Size = ...,
        *,
        depth: bool = False,
        normals: bool = False,
        backend: _Backend = "auto",
        device: str | int | None = None,
        validate: bool = False,
    ) -> Renderer: ...
    def render(
        self, camera: Camera, *, samples: int = 1, **look: Unpack[Look]
    ) -> Picture: ...
    @property
    def device(self) -> str: ...
    @property
    def size(self) -> _Size: ...

def open(
    path: str | PathLike[str],
    *,
    weld: bool = False,
    crease: float | None = None,
    textures: bool = True,
    color_by: str | None = None,
    color_range: tuple[float, float] | None = None,
    frame_all: bool = False,
) -> Model: ...
def devices() -> list[str]: ...
def compare(
    reference: Picture | NDArray[np.uint8] | NDArray[np.float32] | str | PathLike[str],
    picture: Picture | NDArray[np.uint8] | NDArray[np.float32] | str | PathLike[str],
    *,
    pixels_per_degree: float = ...,
    flip_map: bool = False,
) -> Comparison: ...
