"""Tests of the installed package: beside the command line (SURFEL_BIN), closed forms and trimesh.

Run by scripts/wheel-test.sh, with pytest or without: python test_surfel.py
"""

import inspect
import math
import os
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import numpy as np

import surfel

BIN = os.environ.get("SURFEL_BIN")
REPOSITORY = Path(__file__).resolve().parents[2]
SCAN = REPOSITORY / "assets" / "ring.obj"


def refused(kind, part, call):
    """The call raises `kind` with `part` in its text."""
    try:
        call()
    except kind as error:
        assert part in str(error), f"{error!s} names no {part!r}"
    else:
        raise AssertionError(f"nothing was refused: {part}")


def sphere(triangles=20_000):
    return surfel.open(f"generate:sphere:{triangles}")


def program(*arguments):
    subprocess.run([BIN, *map(str, arguments)], check=True, env={**os.environ, "SURFEL_CALIBRATE": "off"})


def test_facts_of_a_generated_model():
    model = surfel.open("generate:square:200")
    assert (model.kind, model.triangle_count, model.format) == ("surface", 200, "generated")
    assert model.bounds == ((-0.5, -0.5, 0.0), (0.5, 0.5, 0.0))
    assert model.center == (0.0, 0.0, 0.0) and abs(model.radius - math.sqrt(0.5)) < 1e-6
    assert not model.is_closed and not model.has_colors and model.warnings == []
    assert model.node_count > 200 and model.memory_bytes > 0 and model.up == "y"
    assert surfel.__version__ in repr(surfel.__version__) and "square" in repr(model)


def test_depth_and_normals_are_those_of_a_sphere():
    model = sphere(500_000)
    camera = surfel.Camera.look_at((0, 0, 3), (0, 0, 0), fov=60, near=0.5, far=10, size=(101, 101))
    assert camera.eye == (0.0, 0.0, 3.0) and camera.size == (101, 101)
    picture = model.render(camera, method="triangles", depth=True, normals=True)
    # The ray through the middle of pixel (i, j) meets the unit sphere at a distance t along the view direction.
    middle = (np.arange(101) + 0.5) / 101 * 2 - 1
    x, y = np.meshgrid(middle * math.tan(math.radians(30)), -middle * math.tan(math.radians(30)))
    a, b, c = x**2 + y**2 + 1, -6.0, 8.0
    d = b * b - 4 * a * c
    with np.errstate(invalid="ignore"):
        t = (-b - np.sqrt(d)) / (2 * a)
    inside = d > 0.05
    outside = d < -0.05
    assert picture.depth.dtype == np.float32 and picture.depth.shape == (101, 101)
    # 1000 x 500 cells: flat triangles lie inside of the sphere by 5e-6 at most, seen along steep rays more.
    assert np.abs(picture.depth - t)[inside].max() < 2e-4
    assert np.isinf(picture.depth[outside]).all()
    assert (picture.coverage[inside] == 1).all() and (picture.coverage[outside] == 0).all()
    points = np.stack([x * t, y * t, 3 - t], -1)
    cosine = (picture.normals * points).sum(-1)
    assert cosine[inside].min() > 0.9999
    assert (picture.normals[outside] == 0).all()


def test_matrices_take_points_to_pixels():
    camera = surfel.Camera.look_at((3, 2, 5), (0, 0, 0), size=(200, 100))
    target = camera.projection @ camera.view @ np.array([0, 0, 0, 1.0])
    assert np.abs(target[:2] / target[3]).max() < 1e-12
    assert np.allclose(np.linalg.inv(camera.view)[:3, 3], camera.eye)


def test_pictures_are_those_of_the_command_line():
    if not BIN:
        print("no SURFEL_BIN: not compared with the command line")
        return
    with tempfile.TemporaryDirectory() as folder:
        png, npy, json = (Path(folder) / name for name in ("a.png", "d.npy", "c.json"))
        for name, look in [
            ("generate:statue:20000", {"threshold": 3.0}),
            ("generate:torus:20000", {"splat": "filtered", "background": (255, 255, 255)}),
            (str(SCAN), {"method": "triangles", "light_at": (-30.0, 30.0)}),
            ("generate:statue:20000", {"method": "splats", "splat": "disc", "color_by": "level"}),
            ("generate:statue:20000", {"light": "studio", "ambient_occlusion": "on"}),
        ]:
            words = []
            for option, value in look.items():
                text = ",".join(map(str, value)) if isinstance(value, tuple) else value
                words += [f"--{option.replace('_', '-')}={text}"]
            if "light" not in look:
                words += ["--light", "phong" if "light_at" in look else "headlight"]
            if "ambient_occlusion" not in look:
                words += ["--ambient-occlusion", "off"]
            program(
                "render", name, "-q", "-o", png, "--depth", npy, "--save-camera", json,
                "--size", "160x120", "--orbit", "40,10,1.2", "--backend", "cpu", "--samples", 1, *words,
            )  # fmt: skip
            model = surfel.open(name)
            camera = model.orbit(40, 10, 1.2, size=(160, 120))
            picture = model.render(camera, backend="cpu", depth=True, **look)
            found = surfel.compare(png, picture.color)
            assert found["max_level"] == 0 and found["flip"] == 0, (name, look, found)
            assert np.array_equal(np.load(npy), picture.depth), (name, look)
            read = surfel.Camera.read(json)
            assert read.size == (160, 120) and np.allclose(read.view, camera.view)
            again = model.render(read, backend="cpu", **look)
            assert np.array_equal(again.color, picture.color) and again.depth is None
        program("render", "generate:statue:20000", "-q", "-o", png, "--samples", 16, "--backend", "cpu",
                "--size", "80x80", "--threshold", 1, "--light", "headlight",
                "--ambient-occlusion", "off")  # fmt: skip
        model = surfel.open("generate:statue:20000")
        camera = model.orbit(size=(80, 80))
        smooth = model.render(camera, samples=16, threshold=1, backend="cpu")
        assert surfel.compare(png, smooth)["max_level"] <= 0.51
        assert smooth.values.dtype == np.float32 and 0 < smooth.coverage.mean() < 1


def test_backends_draw_the_same():
    model = sphere()
    camera = model.orbit(size=(64, 64))
    reference = model.render(camera, backend="reference")
    auto = surfel.Renderer(model, (64, 64))
    found = surfel.compare(reference, auto.render(camera), flip_map=True)
    # Single pixels of edges may differ by rounding.
    assert found["pixels_past_a_level"] < 10 and found["silhouette_iou"] > 0.99, found
    assert found["flip_map"].shape == (64, 64) and found["flip_map"].max() <= 1
    if auto.device != "cpu":
        vulkan = model.render(camera, backend="vulkan", validate=True)
        assert surfel.compare(reference, vulkan)["pixels_past_a_level"] < 10
        assert auto.device in surfel.devices()


def test_a_renderer_draws_many():
    model = sphere()
    renderer = surfel.Renderer(model, (50, 40), depth=True, backend="cpu")
    del model
    pictures = [
        renderer.render(surfel.Camera.look_at((0, 0, d), (0, 0, 0), near=0.5, far=20, size=(50, 40)))
        for d in (3, 4, 6)
    ]
    covered = [p.coverage.sum() for p in pictures]
    assert covered == sorted(covered, reverse=True) and covered[-1] > 0
    assert [round(float(p.depth[20, 25]), 2) for p in pictures] == [2.0, 3.0, 5.0]
    coarse = renderer.render(surfel.Camera.look_at((0, 0, 3), (0, 0, 0), size=(50, 40)), threshold=20)
    few, many = coarse.statistics, pictures[0].statistics
    assert few["splats"] + few["triangles"] < many["splats"] + many["triangles"]
    assert few["frame_ms"] > 0 and few["nodes_visited"] > 0


def test_differences_of_pictures_are_those_of_their_formulas():
    black = np.zeros((20, 30, 3), np.uint8)
    gray = np.full((20, 30, 3), 51, np.uint8)
    found = surfel.compare(black, gray)
    assert abs(found["psnr"] - 20 * math.log10(5)) < 1e-6 and abs(found["max_level"] - 51) < 1e-4
    assert "missing" not in found and surfel.compare(gray, gray)["psnr"] == math.inf
    floats = surfel.compare(black.astype(np.float32), np.full((20, 30, 3), 0.2, np.float32))
    assert abs(floats["psnr"] - found["psnr"]) < 1e-3
    with_alpha = np.zeros((20, 30, 4), np.uint8)
    other = with_alpha.copy()
    with_alpha[5:10, 5:10, 3] = 255
    found = surfel.compare(with_alpha, other)
    assert (found["missing"], found["extra"]) == (25, 0)
    refused(surfel.InputError, "30", lambda: surfel.compare(black, black[:10]))
    refused(surfel.InputError, "channels", lambda: surfel.compare(black[..., :2], black))
    refused(surfel.InputError, "a picture is", lambda: surfel.compare(3, black))
    # Views that are not contiguous are read as they are seen.
    assert surfel.compare(gray[::2, ::-1], gray[:10])["max_level"] == 0


def test_errors_are_exceptions_that_say_what_is_wrong():
    model = surfel.open("generate:square:8")
    refused(FileNotFoundError, "missing.ply", lambda: surfel.open("missing.ply"))
    with tempfile.TemporaryDirectory() as folder:
        bad = Path(folder) / "bad.ply"
        bad.write_text("ply\nformat ascii 1.0\nelement vertex 5\nend_header\n")
        refused(surfel.InputError, "bad.ply", lambda: surfel.open(bad))
        refused(FileNotFoundError, "none.json", lambda: surfel.Camera.read(Path(folder) / "none.json"))
        refused(surfel.InputError, ".png or .exr", lambda: model.render().save(Path(folder) / "a.jpg"))
        refused(FileNotFoundError, "no-folder", lambda: model.render().save(Path(folder) / "no-folder" / "a.png"))
        model.render().save(Path(folder) / "a.exr")
        assert surfel.compare(Path(folder) / "a.exr", model.render())["max_level"] < 1
    refused(surfel.InputError, "cube", lambda: surfel.open("generate:cube"))
    refused(surfel.InputError, "standard input", lambda: surfel.open("-"))
    refused(surfel.InputError, "crease", lambda: surfel.open("generate:square", crease=200))
    refused(surfel.InputError, "one of triangles", lambda: model.render(method="rays"))
    refused(surfel.InputError, "threshold", lambda: model.render(threshold=-1))
    refused(surfel.InputError, "threshold", lambda: model.render(threshold=math.nan))
    refused(TypeError, "unknown option 'tint'", lambda: model.render(tint=3))
    refused(surfel.InputError, "samples", lambda: model.render(samples=3))
    refused(surfel.InputError, "depth", lambda: model.render(samples=4, depth=True))
    refused(surfel.InputError, "backend", lambda: model.render(backend="magic"))
    refused(surfel.InputError, "16384", lambda: model.orbit(size=(0, 5)))
    refused(surfel.InputError, "fill", lambda: model.orbit(fill=0))
    refused(surfel.InputError, "same point", lambda: surfel.Camera.look_at((1, 1, 1), (1, 1, 1)))
    refused(surfel.InputError, "near", lambda: surfel.Camera.look_at((1, 1, 1), (0, 0, 0), near=5, far=2))
    refused(surfel.InputError, "no camera", lambda: surfel.Camera.from_json("{}"))
    # What a backend cannot draw is refused, and the renderer goes on.
    renderer = surfel.Renderer(model, (20, 20), backend="cpu")
    camera = model.orbit(size=(20, 20))
    refused(surfel.InputError, "", lambda: renderer.render(camera, splat="gauss"))
    refused(surfel.InputError, "the renderer's", lambda: renderer.render(model.orbit(size=(9, 9))))
    assert renderer.render(camera).coverage.sum() > 0
    assert issubclass(surfel.InputError, surfel.Error) and issubclass(surfel.DeviceError, surfel.Error)


def test_other_threads_go_on_while_a_picture_is_drawn():
    model = sphere(200_000)
    camera = model.orbit(size=(700, 700))
    state = {}

    def draw():
        state["began"] = True
        model.render(camera, backend="reference", samples=4)
        state["ended"] = True

    thread = threading.Thread(target=draw)
    thread.start()
    steps = 0
    while "ended" not in state:
        time.sleep(0.001)
        steps += "began" in state
    thread.join()
    # With Python's lock held this thread would get a step or two.
    assert steps > 20, steps


def test_types_are_told_for_everything():
    stub = (Path(surfel.__file__).parent / "__init__.pyi").read_text()
    assert (Path(surfel.__file__).parent / "py.typed").exists()
    for name in surfel.__all__:
        assert f"class {name}" in stub or f"def {name}" in stub or f"{name}:" in stub, name
        for member, _ in inspect.getmembers(getattr(surfel, name)):
            if not member.startswith("_") and inspect.isclass(getattr(surfel, name)):
                known = f"def {member}(" in stub or issubclass(getattr(surfel, name), Exception)
                assert known, f"{name}.{member}"


def test_the_same_as_trimesh():
    try:
        import trimesh
    except ImportError:
        print("no trimesh: not compared with it")
        return
    mesh = trimesh.creation.icosphere(subdivisions=4, radius=2.0)
    mesh.apply_transform(trimesh.transformations.rotation_matrix(0.3, [1, 2, 3], [4, 0, 0]))
    mesh.apply_scale([1, 0.6, 1.3])
    mesh.apply_translation([10, 20, 30])
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "ball.ply"
        mesh.export(path)
        model = surfel.open(path)
    assert (model.vertex_count, model.triangle_count) == (len(mesh.vertices), len(mesh.faces))
    assert model.is_closed == mesh.is_watertight
    assert np.allclose(model.bounds, mesh.bounds, atol=1e-5)
    camera = model.orbit(50, 30, 1, size=(48, 48))
    picture = model.render(camera, method="triangles", depth=True, normals=True, culling="off")
    # Rays through the middles of pixels, by the matrices alone.
    middle = (np.arange(48) + 0.5) / 48 * 2 - 1
    x, y = (v.ravel() for v in np.meshgrid(middle, -middle))
    far = np.linalg.inv(camera.projection @ camera.view) @ np.stack([x, y, np.ones_like(x), np.ones_like(x)])
    eye = np.array(camera.eye)
    rays = (far[:3] / far[3]).T - eye
    rays /= np.linalg.norm(rays, axis=1)[:, None]
    points, index, faces = mesh.ray.intersects_location(np.tile(eye, (len(rays), 1)), rays, multiple_hits=False)
    depth = np.full(48 * 48, np.inf)
    depth[index] = -(camera.view[2, :3] @ points.T + camera.view[2, 3])
    ours = picture.depth.ravel().astype(float)
    differ = np.isinf(ours) != np.isinf(depth)
    # Rays through an edge may hit or miss.
    assert differ.sum() <= 4 and len(index) > 500, (differ.sum(), len(index))
    both = np.isfinite(ours) & np.isfinite(depth)
    off = np.abs(ours[both] - depth[both]).max()
    assert off < 2e-4, off
    # Ours are smooth normals, trimesh's those of the triangle: of 5120 triangles they are within 4 degrees.
    normals = np.zeros((48 * 48, 3))
    normals[index] = mesh.face_normals[faces]
    assert (picture.normals.reshape(-1, 3) * normals).sum(-1)[both].min() > math.cos(math.radians(5))


def pyrender_depth(mesh, size, pose, yfov, near, far):
    """Depth of a picture by pyrender, 0 where nothing is; none where it cannot draw here, and then says why."""
    os.environ.setdefault("PYOPENGL_PLATFORM", "egl")
    # pyrender 0.1.45 asks for a name that NumPy 2 has no more.
    if not hasattr(np, "infty"):
        np.infty = np.inf
    try:
        import pyrender

        renderer = pyrender.OffscreenRenderer(*size)
    except Exception as error:  # Whatever a missing driver of OpenGL raises.
        print(f"no pyrender here: not compared with it ({error!s:.80})")
        return None
    scene = pyrender.Scene()
    scene.add(pyrender.Mesh.from_trimesh(mesh, smooth=False))
    scene.add(pyrender.PerspectiveCamera(yfov=yfov, znear=near, zfar=far), pose=pose)
    flags = pyrender.RenderFlags
    depth = renderer.render(scene, flags=flags.DEPTH_ONLY | flags.SKIP_CULL_FACES)
    renderer.delete()
    return depth


def test_the_same_as_pyrender():
    try:
        import trimesh
    except ImportError:
        print("no trimesh: not compared with pyrender")
        return
    mesh = trimesh.load(SCAN, process=False, force="mesh")
    # By a file of its triangles: polygons that are not flat are divided in more than one way.
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "ring.ply"
        mesh.export(path)
        model = surfel.open(path)
    radius = model.radius
    eye = np.array(model.center) + np.array([0.9, 0.7, 2.2]) * radius
    near, far = 0.5 * radius, 6 * radius
    # pyrender draws 4 samples a pixel, and its depth is that of the first: Vulkan's and Mesa's standard place of that is
    # (0.375, 0.125) from the lower left. Of our picture of 4 x 4 as many pixels that is one pixel's middle.
    camera = surfel.Camera.look_at(eye, model.center, fov=50, near=near, far=far, size=(640, 480))
    pose = np.linalg.inv(camera.view)
    theirs = pyrender_depth(mesh, (160, 120), pose, math.radians(50), near, far)
    if theirs is None:
        return
    ours = model.render(camera, method="triangles", depth=True, culling="off").depth[3::4, 1::4]
    hit, covered = theirs > 0, np.isfinite(ours)
    assert hit.sum() > 2000, hit.sum()
    # Two rasterizers snap corners to other grids: pixels of the outline alone.
    assert (hit != covered).sum() <= 0.01 * hit.sum(), ((hit != covered).sum(), hit.sum())
    off = np.abs(theirs - ours)[hit & covered] / radius
    print(f"pyrender: {hit.sum()} pixels, {(hit != covered).sum()} differ in coverage, depth by {np.median(off):.1e} radii")
    assert np.median(off) < 1e-5 and np.quantile(off, 0.98) < 1e-3, (np.median(off), off.max())


if __name__ == "__main__":
    tests = [(name, test) for name, test in list(globals().items()) if name.startswith("test_")]
    for name, test in tests:
        start = time.monotonic()
        test()
        print(f"{name}: {time.monotonic() - start:.1f} s", flush=True)
    print(f"{len(tests)} tests hold")
    sys.exit(0)
