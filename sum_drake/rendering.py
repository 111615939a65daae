"""Depth of posed objects, rendered by Drake's RenderEngineVtk: exactly, many at once, or looked up by view direction.

`DepthRenderer` renders one object as a camera sees it. `Atlas` renders many copies in one picture of tiles, for which a
picture of each would be nearly all overhead. `Surface` keeps what such pictures show of an object from every side:
from afar, what a camera sees of an object depends on the direction it looks along and nothing else.

VTK returns wrong pictures, with no more than a warning, when an engine is used from another thread than its own; here
that raises RuntimeError. Engines get untextured copies with few faces, which is all that depth needs.
"""

import dataclasses
import threading
from typing import TYPE_CHECKING, Any

import numpy as np
import trimesh
from numpy.typing import NDArray
from pydrake.common import MemoryFile
from pydrake.geometry import (
    ClippingRange,
    DepthRange,
    DepthRenderCamera,
    FramePoseVector,
    GeometryFrame,
    GeometryInstance,
    InMemoryMesh,
    MakeRenderEngineVtk,
    Mesh,
    PerceptionProperties,
    RenderCameraCore,
    RenderEngineVtkParams,
    RenderLabel,
    SceneGraph,
)
from pydrake.math import RigidTransform
from pydrake.systems.sensors import CameraInfo

from sum_drake.geometry import apply, inverse
from sum_drake.types import Array, Box, Camera, Frame, Immutable, readonly

if TYPE_CHECKING:
    from sum_drake.objects import Catalogue

FAR = 30.0
"""Distance of the atlas' camera, metres: rays across an object are parallel to within a third of a degree."""


def mesh_arrays(catalogue: "Catalogue", label: str) -> tuple[Array, NDArray[np.int64]]:
    """Vertices (v, 3) and faces (f, 3) of a label's mesh, in O."""
    mesh = catalogue[label].load_mesh()
    return np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces, dtype=np.int64)


def coarse(vertices: Array, faces: NDArray[np.int64], limit: int) -> tuple[Array, NDArray[np.int64]]:
    """A copy of a mesh with at most `limit` faces. Vertices (v, 3) and faces (f, 3) in and out.

    Edges are collapsed where that changes the shape least (Garland and Heckbert, "Surface Simplification Using Quadric
    Error Metrics", 1997). What is left of a mesh of many loose parts, whose edges end, loses faces as the vertices of
    each cell of a grid are merged to their mean.
    """
    if len(faces) <= limit:
        return vertices, faces
    simple = trimesh.Trimesh(vertices, faces).simplify_quadric_decimation(face_count=limit)
    if len(simple.faces):
        vertices, faces = np.asarray(simple.vertices, np.float64), np.asarray(simple.faces, np.int64)
    cell = float(np.ptp(vertices, axis=0).max()) / 256
    while len(faces) > limit:
        keys = np.floor((vertices - vertices.min(axis=0)) / cell).astype(np.int64)
        _, index, counts = np.unique(keys, axis=0, return_inverse=True, return_counts=True)
        index = index.reshape(-1)
        merged = np.stack([np.bincount(index, vertices[:, i]) for i in range(3)], -1) / counts[:, None]
        triangles = index[faces]
        proper = (triangles != np.roll(triangles, 1, axis=1)).all(axis=1)
        _, first = np.unique(np.sort(triangles[proper], axis=1), axis=0, return_index=True)
        if len(first) <= limit:
            return merged, triangles[proper][np.sort(first)]
        cell *= 1.15
    return vertices, faces


def _in_memory(vertices: Array, faces: NDArray[np.int64]) -> Mesh:
    # Drake wants normals in an OBJ; depth does not look at them, so that one serves all faces.
    lines = ["vn 0 0 1"]
    lines += ["v {:.7g} {:.7g} {:.7g}".format(*vertex) for vertex in vertices]
    lines += ["f {}//1 {}//1 {}//1".format(*face) for face in (faces + 1).tolist()]
    return Mesh(InMemoryMesh(mesh_file=MemoryFile("\n".join(lines) + "\n", ".obj", "object")))


class _Scene:
    """A SceneGraph of its own with a depth engine and `copies` of a mesh that can be posed in the camera's frame."""

    def __init__(self, mesh: Mesh, copies: int) -> None:
        self._thread = threading.get_ident()
        self._graph = SceneGraph()
        self._graph.AddRenderer("depth", MakeRenderEngineVtk(RenderEngineVtkParams()))
        source = self._graph.RegisterSource("objects")
        self._frames = []
        for i in range(copies):
            frame = self._graph.RegisterFrame(source, GeometryFrame(f"copy{i}"))
            copy = GeometryInstance(RigidTransform(), mesh, f"copy{i}")
            properties = PerceptionProperties()
            properties.AddProperty("label", "id", RenderLabel(1))
            copy.set_perception_properties(properties)
            self._graph.RegisterGeometry(source, frame, copy)
            self._frames.append(frame)
        self._context = self._graph.CreateDefaultContext()
        self._poses = self._graph.get_source_pose_port(source)

    rendered = 0
    """Poses that were rendered."""

    def depth(self, X_CFs: Array, camera: Camera, near: float, far: float) -> NDArray[np.float32]:
        """z-depth (h, w) of copies posed at (n, 4, 4), n <= copies; 0 where there is nothing."""
        if threading.get_ident() != self._thread:
            raise RuntimeError("a depth renderer was used outside the thread that made it, where VTK renders wrongly")
        self.rendered += len(X_CFs)
        poses = FramePoseVector()
        behind = RigidTransform([0.0, 0.0, -far])
        for i, frame in enumerate(self._frames):
            shown = i < len(X_CFs)
            X = RigidTransform(X_CFs[i]) if shown else behind
            poses.set_value(frame, X)
        self._poses.FixValue(self._context, poses)
        query = self._graph.get_query_output_port().Eval(self._context)
        image = query.RenderDepthImage(
            _drake_camera(camera, near, far), SceneGraph.world_frame_id(), RigidTransform()
        ).data[..., 0]
        return np.where(image < far, image, np.float32(0))  # infinite where there is nothing


def _drake_camera(camera: Camera, near: float, far: float) -> DepthRenderCamera:
    # RenderEngineVtk puts the centre of pixel i at i + .5.
    info = CameraInfo(camera.width, camera.height, camera.fx, camera.fy, camera.cx + 0.5, camera.cy + 0.5)
    core = RenderCameraCore("depth", info, ClippingRange(near, far), RigidTransform())
    return DepthRenderCamera(core, DepthRange(near, far))


class DepthRenderer:
    """Renders the depth of one posed object at a time, with an engine a label that is built when first asked for."""

    def __init__(self, catalogue: "Catalogue", *, faces: int = 4000) -> None:
        self._catalogue = catalogue
        self._faces = faces
        self._scenes: dict[str, tuple[_Scene, Array, float]] = {}

    @property
    def rendered(self) -> int:
        """Poses that were rendered so far."""
        return sum(scene.rendered for scene, _, _ in self._scenes.values())

    def warm(self, label: str) -> None:
        """Builds the engine of a label, unless it is there."""
        if label in self._scenes:
            return
        vertices, faces = mesh_arrays(self._catalogue, label)
        p_OM, radius = _ball(vertices, faces)
        self._scenes[label] = (_Scene(_in_memory(*coarse(vertices, faces, self._faces)), 1), p_OM, radius)

    def depth(self, label: str, X_CO: Array, camera: Camera) -> NDArray[np.float32]:
        """z-depth (h, w) in metres of the object at X_CO (4, 4), 0 where it is not seen.

        Raises RuntimeError when called from another thread than the one that asked for the label first.
        """
        self.warm(label)
        scene, p_OM, radius = self._scenes[label]
        # Planes tight around the object keep VTK's depth exact to a few micrometres.
        z = float(X_CO[2, :3] @ p_OM + X_CO[2, 3])
        far = z + 1.01 * radius
        near = max(z - 1.01 * radius, 0.01)
        if far <= near:
            return np.zeros((camera.height, camera.width), dtype=np.float32)
        # Drake wants the principal point inside the picture: a crop beside it is cut from one that reaches there.
        left, top = max(0, int(np.ceil(-camera.cx))), max(0, int(np.ceil(-camera.cy)))
        width = max(left + camera.width, int(left + camera.cx) + 2)
        height = max(top + camera.height, int(top + camera.cy) + 2)
        picture = Camera(width, height, camera.fx, camera.fy, camera.cx + left, camera.cy + top)
        depth = scene.depth(X_CO[None], picture, near, far)
        return np.ascontiguousarray(depth[top : top + camera.height, left : left + camera.width])


class Atlas:
    """Renders many poses of one object in one picture: a square of tiles, one copy of the object in each.

    A single camera far away looks at all copies. Each is turned about the camera's centre onto its tile's ray, so that
    it is seen as if it stood in the middle of the picture, and is drawn at the same scale whatever its distance from
    the true camera: a pixel is `pixel` metres wide. Poses in excess of the copies are rendered in further pictures.
    """

    def __init__(
        self, vertices: Array, faces: NDArray[np.int64], *, tile: int = 32, columns: int = 9, limit: int = 300
    ) -> None:
        self.p_OM, radius = _ball(vertices, faces)
        """(3,): the object's middle M, the centroid of its surface, which each tile shows at its centre."""
        self.tile = tile
        self.pixel = 2.02 * radius / tile
        self._columns = columns
        self._range = FAR - 1.5 * radius, FAR + 1.5 * radius
        self._scene = _Scene(_in_memory(*coarse(vertices, faces, limit)), columns**2)
        size, focal = columns * tile, FAR / self.pixel
        middle = (size - 1) / 2
        self._camera = Camera(size, size, focal, focal, middle, middle)
        u = (np.arange(size) - middle) / focal
        rays = np.stack([*np.meshgrid(u, u), np.ones((size, size))], -1)  # (size, size, 3)
        corners = (np.arange(columns) + 0.5) * tile - 0.5 - middle
        centres = np.stack([*np.meshgrid(corners, corners), np.full((columns, columns), focal)], -1).reshape(-1, 3)
        self._R_AVs = view_rotations(centres)  # (columns^2, 3, 3): the frame V of each tile in the far camera's, A
        rays_V = self._tiles(rays) @ self._R_AVs[:, None]
        self._rays_V = rays_V.astype(np.float32).reshape(columns**2, -1, 3)  # (columns^2, tile^2, 3)

    @property
    def rendered(self) -> int:
        """Poses that were rendered so far."""
        return self._scene.rendered

    def _tiles(self, image: NDArray[Any]) -> NDArray[Any]:
        n, t = self._columns, self.tile
        return np.moveaxis(image.reshape(-1, t, n, t, image[0, 0].size), 2, 1).reshape(-1, t, t, image[0, 0].size)

    def points(self, R_VOs: Array) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
        """What is seen of the object turned by R_VOs (n, 3, 3) when looking along the z axis of V at its middle.

        Returns p_MQ_V (n, k, 3), the points that the pixels of each tile see, row by row, relative to the middle, k of
        them where most are seen, and (n, k), which of them are any.
        """
        depth = np.zeros((len(R_VOs), self.tile**2), dtype=np.float32)
        copies = self._columns**2
        for start in range(0, len(R_VOs), copies):
            part = slice(start, min(start + copies, len(R_VOs)))
            R_AVs = self._R_AVs[: part.stop - start]
            R_AOs = R_AVs @ R_VOs[part]
            X_AOs = np.tile(np.eye(4), (len(R_AOs), 1, 1))
            X_AOs[:, :3, :3] = R_AOs
            X_AOs[:, :3, 3] = FAR * R_AVs[:, :, 2] - R_AOs @ self.p_OM
            # Only as many rows of tiles as there are poses for, but with the middle, which Drake wants to be inside.
            rows = max(-(-len(R_AOs) // self._columns), self._columns // 2 + 1)
            picture = dataclasses.replace(self._camera, height=rows * self.tile)
            tiles = self._tiles(self._scene.depth(X_AOs, picture, *self._range))
            depth[part] = tiles[: len(R_AOs)].reshape(len(R_AOs), -1)
        # Most of a tile shows nothing, which would cost whoever compares the points as much as what it shows.
        row, pixel = np.nonzero(depth)
        counts = np.bincount(row, minlength=len(depth))
        place = np.arange(len(row)) - np.repeat(np.cumsum(counts) - counts, counts)
        points = np.zeros((len(depth), max(int(counts.max(initial=0)), 1), 3), dtype=np.float32)
        points[row, place] = depth[row, pixel, None] * self._rays_V[row % copies, pixel]
        points[row, place, 2] -= FAR
        return points, np.arange(points.shape[1]) < counts[:, None]


@dataclasses.dataclass(frozen=True, eq=False)
class Surface(Immutable):
    """What is seen of an object from each of many directions: points of its surface, with normals.

    Every view shows `k` points, spread evenly over the pixels of a depth render, so that each stands for the same share
    `areas` of the silhouette.
    """

    p_OM: Array
    """(3,): the object's middle, which the views look at."""
    radius: float
    """Of a ball about the middle that holds the object, metres."""
    directions: NDArray[np.float32]
    """(views, 3): unit vectors from the camera to the middle, in O."""
    points: NDArray[np.float32]
    """(views, k, 3): p_MQ_O."""
    normals: NDArray[np.float32]
    """(views, k, 3): outward unit normals, in O."""
    areas: NDArray[np.float32]
    """(views,): square metres across the line of sight that one point of the view stands for."""


def see_surface(
    vertices: Array,
    faces: NDArray[np.int64],
    *,
    views: int = 1000,
    points: int = 192,
    samples: int = 8000,
    tile: int = 36,
    seed: int = 0,
) -> Surface:
    """Renders the mesh (v, 3), (f, 3) from `views` directions and keeps what each shows.

    A point is the sample of the true surface next to what a pixel of the render saw. A mesh that is wound
    inconsistently will do: normals are turned to the camera.
    """
    from scipy.spatial import cKDTree

    atlas = Atlas(vertices, faces, tile=tile, limit=600)
    p_MSs, n_Ss = sample_mesh(vertices - atlas.p_OM, faces, samples, np.random.default_rng(seed))
    tree = cKDTree(p_MSs)
    directions = fibonacci_sphere(views)
    R_VOs = np.swapaxes(view_rotations(directions), -1, -2)
    p_MQs, seen = atlas.points(R_VOs)
    shown = np.zeros((views, points, 3))
    for view in range(views):
        pixels = p_MQs[view][seen[view]]
        if not len(pixels):
            continue
        evenly = ((np.arange(points) + 0.5) / points * len(pixels)).astype(int)
        shown[view] = pixels[evenly] @ R_VOs[view]
    # Something thin, seen along its side, may fall between pixels: its points are a neighbour's then, with no area.
    something = seen.any(axis=1)
    along = np.where(something, directions @ directions.T, -np.inf)
    shown = shown[np.where(something, np.arange(views), along.argmax(axis=1))]
    distance, near = tree.query(shown, k=5)  # (views, points, 5)
    facing = -np.einsum("vpki,vi->vpk", n_Ss[near], directions)
    # The other side of a thin wall is as near as the one that is seen, but faces away.
    best = (distance + 3 * atlas.pixel * (facing < 0.05)).argmin(-1)[..., None]
    chosen = np.take_along_axis(near, best, -1)[..., 0]
    towards = np.where(np.take_along_axis(facing, best, -1) < 0, -1.0, 1.0)
    return Surface(
        readonly(atlas.p_OM),
        atlas.pixel * tile / 2.02,
        readonly(directions, np.float32),
        readonly(p_MSs[chosen], np.float32),
        readonly(towards * n_Ss[chosen], np.float32),
        readonly(seen.sum(axis=1) * atlas.pixel**2 / points, np.float32),
    )


def predicted_box(vertices: Array, X_WO: Array, frame: Frame) -> Box:
    """The box around the pixel centres within the projection of vertices (v, 3) at X_WO (4, 4), cut at the picture.

    Of an object that the border cuts it holds what is seen, but may be larger than that. Empty (0, 0, 0, 0) when the
    object is out of the picture or reaches behind the camera.
    """
    camera = frame.camera
    p_C = apply(inverse(frame.X_WC) @ X_WO, vertices)
    if not (p_C[:, 2] > 0.01).all():
        return 0.0, 0.0, 0.0, 0.0
    u = camera.fx * p_C[:, 0] / p_C[:, 2] + camera.cx
    v = camera.fy * p_C[:, 1] / p_C[:, 2] + camera.cy
    left, right = max(np.ceil(u.min()), 0.0), min(np.floor(u.max()), camera.width - 1.0)
    top, bottom = max(np.ceil(v.min()), 0.0), min(np.floor(v.max()), camera.height - 1.0)
    if left > right or top > bottom:
        return 0.0, 0.0, 0.0, 0.0
    return float(left), float(top), float(right - left + 1), float(bottom - top + 1)


def view_rotations(directions: Array) -> Array:
    """The smallest rotations R_CV (n, 3, 3) that bring the z axis onto the directions (n, 3), of any length."""
    d = directions / np.linalg.norm(directions, axis=-1, keepdims=True)
    x, y, z = np.moveaxis(d, -1, 0)
    # Looking straight back, any half-turn about an axis across z does.
    k = 1.0 / np.maximum(1.0 + z, 1e-9)
    R: Array = np.stack(
        [np.stack([1 - k * x * x, -k * x * y, x], -1), np.stack([-k * x * y, 1 - k * y * y, y], -1),
         np.stack([-x, -y, z], -1)], -2,
    )  # fmt: skip
    R[1.0 + z < 1e-6] = np.diag([1.0, -1.0, -1.0])
    return R


def fibonacci_sphere(n: int) -> Array:
    """n unit vectors (n, 3) spread evenly: a Fibonacci lattice on the sphere."""
    i = np.arange(n) + 0.5
    z = 1 - 2 * i / n
    angle = np.pi * (1 + np.sqrt(5)) * i
    r = np.sqrt(1 - z * z)
    return np.stack([r * np.cos(angle), r * np.sin(angle), z], -1)


def _ball(vertices: Array, faces: NDArray[np.int64]) -> tuple[Array, float]:
    """The centroid of a mesh's surface, (3,), and the radius of the ball about it that holds the mesh.

    Not the middle of its extents: about the centroid a turned mug's body stays put, and it is the body that is seen.
    """
    corners = vertices[faces]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    middle: Array = areas @ corners.mean(axis=1) / areas.sum()
    return middle, float(np.linalg.norm(vertices - middle, axis=1).max())


def sample_mesh(vertices: Array, faces: NDArray[np.int64], n: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """n points (n, 3) spread over a mesh by area, and the unit normals (n, 3) of their faces."""
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    normals = np.cross(b - a, c - a)
    double_areas = np.linalg.norm(normals, axis=1)
    total = np.cumsum(double_areas)
    face = np.searchsorted(total, (np.arange(n) + rng.random(n)) / n * total[-1], side="right").clip(max=len(faces) - 1)
    s, t = rng.random((2, n, 1))
    s, t = np.where(s + t > 1, 1 - s, s), np.where(s + t > 1, 1 - t, t)
    points = a[face] + s * (b - a)[face] + t * (c - a)[face]
    order = rng.permutation(n)
    unit = normals[face] / np.maximum(double_areas[face], 1e-30)[:, None]
    return points[order], unit[order]
