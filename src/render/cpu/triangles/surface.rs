//! What triangles are like: normals and colors of their corners, and their textures.

use super::{FaceEdge, FacePart, FrameLight, MeshVertices, PictureFace};
use crate::abi::Vertex;
use crate::math::octahedral;
use crate::textures::{TextureImage, WeightSteps};
use crate::tree::{Model, ModelTextures};
use glam::{Mat3, Vec2, Vec3};

/// What triangles of a mesh look like.
#[derive(Debug, Clone, Copy)]
pub struct SurfaceMesh<'a> {
    vertices: &'a [Vertex],
    textures: Option<&'a ModelTextures>,
}

impl<'a> SurfaceMesh<'a> {
    /// Surface of a model.
    pub fn of(model: &'a Model) -> Self {
        Self {
            vertices: &model.vertices,
            textures: model.textures.as_deref(),
        }
    }
}

/// What the corners of a triangle are like.
pub(in crate::render::cpu) struct FaceSurface<'m> {
    /// In view space; zero where there is none, which leaves the others to decide.
    pub(in crate::render::cpu) normals: Mat3,
    pub(in crate::render::cpu) colors: Mat3,
    /// What it shows in the place of these colors.
    pub(in crate::render::cpu) texture: Option<FaceTexture<'m>>,
}

/// Where a triangle in the picture is in an image.
#[derive(Clone, Copy)]
pub(in crate::render::cpu) struct FaceTexture<'m> {
    image: &'m TextureImage,
    places: [Vec2; 3],
    /// Of the weights in a [`SurfacePlace`].
    steps: WeightSteps,
}

impl FaceTexture<'_> {
    /// Red, green and blue where the corners have weights, which are those of a [`SurfacePlace`].
    #[inline]
    pub(in crate::render::cpu) fn color_at(&self, weights: Vec3) -> Vec3 {
        self.image.seen(&self.places, weights, self.steps)
    }
}

impl<'m> FaceTexture<'m> {
    /// Texture of a face, if it has one. `clipped` is as in [`FacePart::clipped`].
    fn of(face: &PictureFace, mesh: SurfaceMesh<'m>, clipped: Option<&Mat3>) -> Option<Self> {
        let (image, places) = mesh.textures?.of_triangle(face.corners)?;
        let places = match clipped {
            Some(weights) => [weights.x_axis, weights.y_axis, weights.z_axis].map(|weights| {
                places[0] * weights.x + places[1] * weights.y + places[2] * weights.z
            }),
            None => places,
        };
        let (area, edges) = face.edges_from([face.pixels[0], face.pixels[1]]);
        let of = |step: fn(&FaceEdge) -> i64| {
            let steps = [0, 1, 2].map(|i: usize| step(&edges[i]) as f32 / area);
            Vec3::from_array(steps) * face.inverse_w
        };
        Some(Self {
            image,
            places,
            steps: WeightSteps {
                right: of(|edge| edge.right),
                down: of(|edge| edge.down),
            },
        })
    }
}

impl<'m> FaceSurface<'m> {
    pub(in crate::render::cpu) fn of(
        face: &PictureFace,
        part: &FacePart,
        meshes: MeshVertices<'m>,
        light: &FrameLight,
    ) -> Self {
        let mesh = meshes[part.mesh];
        let vertices = mesh.vertices;
        let vertex = face.corners.map(|corner| &vertices[corner as usize]);
        let [a, b, c] = vertex.map(|v| match v.color[3] {
            0 => Vec3::ZERO,
            _ => light.turn * octahedral::decode(v.normal),
        });
        let normals = Mat3::from_cols(a, b, c);
        let [a, b, c] = vertex.map(|v| {
            let [red, green, blue, _] = v.color.map(f32::from);
            Vec3::new(red, green, blue) / 255.0
        });
        let colors = Mat3::from_cols(a, b, c);
        let clipped = part.clipped.get(face.clipped as usize);
        let texture = match light.has_colors {
            true => FaceTexture::of(face, mesh, clipped),
            false => None,
        };
        match clipped {
            Some(weights) => Self {
                normals: normals * *weights,
                colors: colors * *weights,
                texture,
            },
            None => Self {
                normals,
                colors,
                texture,
            },
        }
    }

    /// Color of the surface where the corners have weights, which are those of a [`SurfacePlace`].
    #[inline]
    pub(super) fn color_at(&self, weights: Vec3) -> Vec3 {
        match &self.texture {
            Some(texture) => texture.color_at(weights),
            None => self.colors * (weights / weights.element_sum()),
        }
    }
}
