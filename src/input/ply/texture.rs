//! Textures of PLY: named in `TextureFile` comments, with coordinates of vertices (`s`, `t`) or of the corners of faces (list
//! `texcoord`), and numbers of textures a face (`texnumber`).

use glam::Vec2;

use super::header::PlyHeader;
use crate::input::assemble::RawMesh;
use crate::input::job::ReadJob;
use crate::input::mtl::MaterialFolder;
use crate::input::part::PartFate;
use crate::input::text::shown;
use crate::input::textures::{ImageBytes, ImageSource, RawTextures};
use crate::textures::{NO_IMAGE, WrapMode};

/// Where the corners of triangles are, as far as faces say it.
#[derive(Debug, Default)]
pub(super) struct FacePlaces {
    /// From the lower left, of all triangles up to the last that has some; empty where vertices have them.
    corners: Vec<[Vec2; 3]>,
    /// Of all triangles up to the last that has one.
    image_of: Vec<u32>,
}

impl FacePlaces {
    /// Adds a face with the triangles `first..end`, a fan: two numbers of each corner, and the number of its texture.
    pub(super) fn push(&mut self, [first, end]: [usize; 2], places: Option<&[f32]>, texture: f64) {
        // Casts saturate; numbers that name nothing are none.
        let mut image = if texture >= 0.0 {
            texture as u32
        } else {
            NO_IMAGE
        };
        if let Some(places) = places {
            let (pairs, _) = places.as_chunks::<2>();
            let corner = |index: usize| pairs.get(index).copied().map(Vec2::from_array);
            self.corners.resize(first, [Vec2::ZERO; 3]);
            for index in 1..=end - first {
                let own = [corner(0), corner(index), corner(index + 1)];
                self.corners.push(match own {
                    [Some(a), Some(b), Some(c)] => [a, b, c],
                    _ => {
                        image = NO_IMAGE;
                        [Vec2::ZERO; 3]
                    }
                });
            }
        }
        self.image_of.resize(first, NO_IMAGE);
        self.image_of.resize(end, image);
    }
}

/// What was read of textures; none where a file names none, or says nowhere where they are.
pub(super) fn textures_of(
    job: &mut ReadJob<'_>,
    header: &PlyHeader,
    (places, faces): (Vec<Vec2>, FacePlaces),
    raw: &RawMesh,
) -> Option<RawTextures> {
    let has_places = !places.is_empty() || !faces.corners.is_empty();
    if header.textures.is_empty() {
        return None;
    }
    if !job.options.textures || !has_places || raw.triangles.is_empty() {
        let why = match job.options.textures {
            false => "not asked for",
            true => "nothing says where it is",
        };
        for name in &header.textures {
            let name = format!("texture {}", shown(name.as_bytes()));
            job.inventory.add(name, 1, PartFate::LeftOut, why);
        }
        return None;
    }
    let upright = |place: Vec2| Vec2::new(place.x, 1.0 - place.y);
    let corners = if faces.corners.is_empty() {
        let place = |corner: u32| places.get(corner as usize).copied().unwrap_or_default();
        let corners = raw.triangles.iter();
        corners
            .map(|corners| corners.map(|corner| upright(place(corner))))
            .collect()
    } else {
        let corners = faces.corners.iter();
        corners.map(|corners| corners.map(upright)).collect()
    };
    let image_of = match faces.image_of.is_empty() {
        true => vec![0; raw.triangles.len()],
        false => faces.image_of,
    };
    let mut folder = job.folder.map(MaterialFolder::new);
    let sources = header.textures.iter().map(|name| {
        let bytes = match &mut folder {
            None => ImageBytes::Missing("the model was not read from a file".to_owned()),
            Some(folder) => folder
                .find(name)
                .map_or_else(ImageBytes::Missing, ImageBytes::File),
        };
        ImageSource {
            name: name.clone(),
            bytes,
            wrap: [WrapMode::Repeat; 2],
            tint: None,
        }
    });
    Some(RawTextures {
        corners,
        image_of,
        sources: sources.collect(),
    })
}
