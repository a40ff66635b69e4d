//! Base color textures of glTF: which image a primitive shows, and where its corners are in it.

use std::path::{Component, Path};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use glam::Vec2;
use serde_json::Value;

use super::accessor::GltfStore;
use super::container::without_percents;
use super::document::{GltfMaterial, GltfPrimitive};
use crate::input::Error;
use crate::input::job::ReadJob;
use crate::input::textures::{ImageBytes, ImageSource, ImageTint, RawTextures};
use crate::textures::{NO_IMAGE, WrapMode};

/// Most bytes that an image in an address of its own may take.
const LARGEST_ADDRESS: usize = 1 << 30;

/// The textures of a file as far as it has been read.
#[derive(Default)]
pub(super) struct SceneTextures {
    raw: RawTextures,
    /// Number of the image in the file of each source.
    images: Vec<usize>,
    /// Attributes that texture coordinates were read from.
    attributes: Vec<String>,
    /// Primitives whose texture coordinates cannot be read.
    pub(super) faulty: u64,
    /// Vertices under textures have colors of their own, which are not shown.
    pub(super) leaves_colors: bool,
}

/// The base color texture of a material, also under its older name.
pub(super) fn of_material(material: &GltfMaterial) -> Option<&Value> {
    let older = "/KHR_materials_pbrSpecularGlossiness/diffuseTexture";
    let base = material.pbr_metallic_roughness.base_color_texture.as_ref();
    base.or_else(|| material.extensions.pointer(older))
}

/// The base color of a material, linear light, also under its older name.
pub(super) fn base_color(material: &GltfMaterial) -> [f64; 3] {
    let older = material
        .extensions
        .pointer("/KHR_materials_pbrSpecularGlossiness/diffuseFactor");
    let older = older.and_then(|factor| serde_json::from_value::<[f64; 4]>(factor.clone()).ok());
    let [red, green, blue, _] = material
        .pbr_metallic_roughness
        .base_color_factor
        .or(older)
        .unwrap_or([1.0; 4]);
    [red, green, blue]
}

/// How coordinates are scaled, turned and moved (KHR_texture_transform).
struct PlaceTransform {
    offset: Vec2,
    scale: Vec2,
    rotation: f32,
}

impl PlaceTransform {
    fn of(texture: &Value) -> Self {
        let part =
            |name: &str| texture.pointer(&format!("/extensions/KHR_texture_transform/{name}"));
        let two = |name: &str, missing: f32| {
            let two =
                part(name).and_then(|two| serde_json::from_value::<[f32; 2]>(two.clone()).ok());
            Vec2::from_array(two.unwrap_or([missing; 2]))
        };
        Self {
            offset: two("offset", 0.0),
            scale: two("scale", 1.0),
            rotation: part("rotation").and_then(Value::as_f64).unwrap_or(0.0) as f32,
        }
    }

    fn apply(&self, coordinate: Vec2) -> Vec2 {
        let Vec2 { x, y } = coordinate * self.scale;
        let (sin, cos) = self.rotation.sin_cos();
        Vec2::new(cos * x + sin * y, cos * y - sin * x) + self.offset
    }
}

/// A number of a description.
fn index_of(value: Option<&Value>) -> Option<usize> {
    value
        .and_then(Value::as_u64)
        .and_then(|index| usize::try_from(index).ok())
}

impl SceneTextures {
    /// Adds `triangles` of a primitive, the first of them number `first` and their vertices from `first_vertex` on.
    pub(super) fn add(
        &mut self,
        job: &ReadJob<'_>,
        store: &GltfStore<'_>,
        primitive: &GltfPrimitive,
        count: usize,
        (triangles, first, first_vertex): (&[[u32; 3]], usize, u32),
    ) -> Result<(), Error> {
        let material = primitive
            .material
            .and_then(|index| store.document.materials.get(index));
        let Some((material, texture)) = material.and_then(|m| Some((m, of_material(m)?))) else {
            return Ok(());
        };
        if !job.options.textures {
            return Ok(());
        }
        let transformed = texture.pointer("/extensions/KHR_texture_transform/texCoord");
        let set = index_of(transformed).or(index_of(texture.get("texCoord")));
        let name = format!("TEXCOORD_{}", set.unwrap_or(0));
        let Some(accessor) = index_of(primitive.attributes.others.get(&name)) else {
            return Ok(());
        };
        let Some(image) = self.source_of(job, store, material, texture) else {
            return Ok(());
        };
        let places = match store.vectors::<2>(job, accessor, 0.0) {
            Ok(places) if places.len() == count => places,
            Err(Error::Cancelled) => return Err(Error::Cancelled),
            // No shape depends on them.
            Ok(_) | Err(_) => {
                self.faulty += 1;
                return Ok(());
            }
        };
        self.leaves_colors |= primitive.attributes.color.is_some();
        if !self.attributes.contains(&name) {
            self.attributes.push(name);
        }
        let transform = PlaceTransform::of(texture);
        self.raw.resize(first);
        self.raw.corners.extend(triangles.iter().map(|corners| {
            corners.map(|corner| {
                let place = places[(corner - first_vertex) as usize];
                transform.apply(Vec2::from_array(place))
            })
        }));
        self.raw.image_of.resize(first + triangles.len(), image);
        Ok(())
    }

    /// The number of the image of a texture, added where it is new; none where the file names none.
    fn source_of(
        &mut self,
        job: &ReadJob<'_>,
        store: &GltfStore<'_>,
        material: &GltfMaterial,
        texture: &Value,
    ) -> Option<u32> {
        let document = store.document;
        let texture = document.textures.get(index_of(texture.get("index"))?)?;
        let packed = ["KHR_texture_basisu", "EXT_texture_webp", "MSFT_texture_dds"];
        let packed = packed.iter().find_map(|name| {
            let source = texture.pointer(&format!("/extensions/{name}/source"));
            index_of(source)
        });
        let index = index_of(texture.get("source")).or(packed)?;
        let image = document.images.get(index)?;
        let sampler = index_of(texture.get("sampler"));
        let sampler = sampler.and_then(|index| document.samplers.get(index));
        let wrap = ["wrapS", "wrapT"].map(|side| {
            let mode = sampler.and_then(|sampler| sampler.get(side));
            match mode.and_then(Value::as_u64) {
                Some(33071) => WrapMode::Clamp,
                Some(33648) => WrapMode::Mirror,
                _ => WrapMode::Repeat,
            }
        });
        let factor = base_color(material);
        let tint = (factor != [1.0; 3]).then_some(ImageTint::Linear(factor));
        let known = self.raw.sources.iter().zip(&self.images);
        let mut known = known.enumerate();
        let known = known.find(|(_, (source, known))| {
            **known == index && source.wrap == wrap && source.tint == tint
        });
        if let Some((number, _)) = known {
            return Some(number as u32);
        }
        let view = image.buffer_view;
        let bytes = match (&image.uri, view) {
            (Some(uri), _) => named_bytes(job, uri),
            (None, Some(view)) => viewed_bytes(store, view),
            (None, None) => ImageBytes::Missing("it has neither name nor bytes".to_owned()),
        };
        self.raw.sources.push(ImageSource {
            name: image.shown_name(index),
            bytes,
            wrap,
            tint,
        });
        self.images.push(index);
        Some(self.raw.sources.len() as u32 - 1)
    }

    /// Tells whether triangles have an image of the file.
    pub(super) fn has_image(&self, index: usize) -> bool {
        self.images.contains(&index)
    }

    /// Tells whether texture coordinates were read from an attribute.
    pub(super) fn reads(&self, attribute: &str) -> bool {
        self.attributes.iter().any(|known| known == attribute)
    }

    /// All of them; none where there are no images.
    pub(super) fn finish(self) -> Option<RawTextures> {
        debug_assert!(
            self.raw
                .image_of
                .iter()
                .all(|&image| image == NO_IMAGE || (image as usize) < self.images.len())
        );
        (!self.raw.sources.is_empty()).then_some(self.raw)
    }
}

/// Bytes in a buffer of the file.
fn viewed_bytes(store: &GltfStore<'_>, view: usize) -> ImageBytes {
    let bytes = store.document.buffer_views.get(view).and_then(|view| {
        let buffer = store.buffers.get(view.buffer)?;
        let start = usize::try_from(view.byte_offset).ok()?;
        let length = usize::try_from(view.byte_length).ok()?;
        buffer.get(start..start.checked_add(length)?)
    });
    match bytes {
        Some(bytes) => ImageBytes::Memory(bytes.into()),
        None => ImageBytes::Missing("its bytes are not in the file".to_owned()),
    }
}

/// Bytes of an address: in the address itself, or a file in the folder of the model.
fn named_bytes(job: &ReadJob<'_>, uri: &str) -> ImageBytes {
    let missing = |reason: &str| ImageBytes::Missing(reason.to_owned());
    if let Some(data) = uri.strip_prefix("data:") {
        let Some((_, text)) = data.split_once(";base64,") else {
            return missing("it is not in base64");
        };
        if text.len() > LARGEST_ADDRESS {
            return missing("it is too long for an address");
        }
        return match STANDARD.decode(text) {
            Ok(bytes) => ImageBytes::Memory(bytes.into()),
            Err(error) => ImageBytes::Missing(format!("it is no base64: {error}")),
        };
    }
    if uri.contains("://") {
        return missing("addresses are not fetched");
    }
    let name = without_percents(uri);
    let path = Path::new(&name);
    let stays_below = path
        .components()
        .all(|part| matches!(part, Component::Normal(_) | Component::CurDir));
    match job.folder {
        Some(folder) if stays_below => ImageBytes::File(folder.join(path)),
        _ => missing("it is not in the folder of the model"),
    }
}
