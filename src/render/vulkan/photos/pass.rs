//! Pass `look.photos`: photographs on whatever surface a frame shows.

use crate::abi::constants::{MOST_FRAME_PHOTOS, PHOTO_VECTORS};
use crate::abi::specialization::{
    HAS_CONSENSUS, HAS_LENSES, HAS_MASKS, HAS_SURFACE_NORMALS, MARKS_UNCOVERED, PHOTO_VISIBILITY,
    SHOWS_SOURCE, WEIGHT_DIRECTION, WEIGHT_FORM,
};
use crate::abi::{ConstantValue, PhotoConstants, shaders};
use crate::gpu::bind::BufferSlice;
use crate::gpu::frame::{FrameRecorder, TargetLoad, UniformBlock};
use crate::gpu::image::DeviceImage as Target;
use crate::gpu::pipeline::{
    DepthMode, PipelineDescription, PrimitiveTopology, ShaderPipeline, VertexRecord,
};
use crate::gpu::{Error, Gpu, lock};
use crate::projective::depth_map::PhotoVisibility;
use crate::projective::frame_photos::{FramePhotos, MOST_PHOTOS, photo_tint};
use crate::projective::lens::LensModel;
use crate::projective::look::{PhotoDirection, WeightForm};
use crate::projective::projected::ProjectedPhoto;
use crate::projective::surface_rays::SurfaceRays;
use crate::render::frame_plan::FramePlan;
use crate::render::vulkan::photos::DevicePhotos;
use crate::render::vulkan::photos::pool::{MapPlace, PhotoPlaces, PixelsPlace};
use crate::render::vulkan::raster_pass;
use crate::render::vulkan::raster_pass::ScreenDraw;
use crate::render::vulkan::targets::{FrameTargets, color_formats};
use crate::render::{PhotoDisplay, Settings};
use glam::Vec3;
use std::sync::Arc;

const _: () = assert!(MOST_PHOTOS == MOST_FRAME_PHOTOS as usize);

/// What a pipeline is made for.
type PhotoVariant = [ConstantValue; 9];

/// The pass with its picture.
#[derive(Debug)]
pub(crate) struct PhotoPass {
    variant: PhotoVariant,
    pipeline: ShaderPipeline,
    picture: Target,
    constants: PhotoConstants,
    photos: DevicePhotos,
}

fn variant_of(photos: &FramePhotos, settings: &Settings, has_normals: bool) -> PhotoVariant {
    let look = &photos.settings;
    let has_lenses = (photos.photos.iter()).any(|chosen| chosen.photo.lens != LensModel::Pinhole);
    [
        HAS_LENSES.is(has_lenses),
        HAS_SURFACE_NORMALS.is(has_normals),
        WEIGHT_FORM.is(match look.form {
            WeightForm::Printed => 0,
            WeightForm::Mended => 1,
            WeightForm::Quality => 2,
        }),
        WEIGHT_DIRECTION.is(match look.direction {
            PhotoDirection::Axis => 0,
            PhotoDirection::Hull => 1,
            PhotoDirection::Ray => 2,
        }),
        PHOTO_VISIBILITY.is(match look.visibility {
            PhotoVisibility::Off => 0,
            PhotoVisibility::Depth => 1,
            PhotoVisibility::DepthSoft => 2,
        }),
        HAS_CONSENSUS.is(look.consensus),
        HAS_MASKS.is(photos.photos.iter().any(|chosen| chosen.mask.is_some())),
        SHOWS_SOURCE.is(settings.photos == PhotoDisplay::Source),
        MARKS_UNCOVERED.is(settings.marks_uncovered),
    ]
}

impl PhotoPass {
    /// Readies a frame: copies photographs, and makes what is missing or of another kind in `made`.
    ///
    /// # Errors
    /// When memory runs out or a Vulkan call fails.
    pub(crate) fn ready(
        made: Option<Self>,
        gpu: &Arc<Gpu>,
        targets: &FrameTargets,
        plan: &FramePlan,
        photos: &DevicePhotos,
    ) -> Result<Self, Error> {
        let frame = &photos.frame;
        let places = lock(&photos.pool).ready(gpu, frame)?;
        let constants = constants_of(
            frame,
            &places,
            &SurfaceRays::of(&plan.view),
            plan.view.width,
        );
        let variant = variant_of(frame, &plan.settings, targets.normal().is_some());
        let color = targets.color();
        let (old, picture) = match made {
            Some(made) => (Some((made.variant, made.pipeline)), Some(made.picture)),
            None => (None, None),
        };
        let pipeline = match old.filter(|(of, _)| *of == variant) {
            Some((_, pipeline)) => pipeline,
            None => ShaderPipeline::new(
                gpu,
                &PipelineDescription {
                    name: "look.photos",
                    vertex: &shaders::FILTERED_NORMALIZE_VERT,
                    fragment: Some(&shaders::LOOK_PHOTOS_FRAG),
                    constants: &variant,
                    record: VertexRecord::NOTHING,
                    topology: PrimitiveTopology::Triangles,
                    colors: color_formats(color.format, false),
                    depth: DepthMode::None,
                    is_additive: false,
                },
            )?,
        };
        let picture = match picture {
            Some(picture) => picture,
            None => Target::new(
                gpu,
                "color by photographs",
                color.format,
                color.width,
                color.height,
            )?,
        };
        Ok(Self {
            variant,
            pipeline,
            picture,
            constants,
            photos: photos.clone(),
        })
    }

    /// Records the pass, which reads colors, depths and normals of the targets.
    ///
    /// # Errors
    /// When the frame has no room for its constants.
    pub(crate) fn record(
        &self,
        frame: &mut FrameRecorder<'_>,
        targets: &FrameTargets,
        plan: &FramePlan,
        constants: UniformBlock,
    ) -> Result<(), Error> {
        let [r, g, b] = plan.context.background;
        let own = frame.uniform(&self.constants)?;
        let pool = lock(&self.photos.pool);
        let pass = frame
            .pass("look.photos")
            .color(&self.picture, TargetLoad::Clear([r, g, b, 0.0]))
            .fragment_storage(pool.buffer());
        let normals = targets.normal().unwrap_or(targets.color());
        let images = [targets.color(), targets.depth(), normals];
        let screen = ScreenDraw {
            pipeline: &self.pipeline,
            uniforms: &[constants, own],
            images: &images,
            storage: &[BufferSlice::whole(pool.buffer())],
        };
        let is_over_all = self.photos.frame.compared.is_some();
        let rect_px = match is_over_all {
            true => plan.context.whole_px(),
            false => plan.context.rect_px,
        };
        raster_pass::full_screen(pass, &screen, rect_px);
        Ok(())
    }

    /// The picture of the last frame.
    pub(crate) fn picture(&self) -> &Target {
        &self.picture
    }
}

fn vector(v: Vec3, last: f32) -> [f32; 4] {
    v.extend(last).to_array()
}

/// What shaders know of the photographs of a frame that are there.
fn constants_of(
    frame: &FramePhotos,
    places: &PhotoPlaces,
    rays: &SurfaceRays,
    width: u32,
) -> PhotoConstants {
    let look = &frame.settings;
    let mut constants = PhotoConstants {
        start: vector(rays.start, f32::from(u8::from(rays.is_perspective))),
        towards: vector(rays.towards, 0.0),
        right: vector(rays.right, 0.0),
        down: vector(rays.down, 0.0),
        direction: vector(frame.direction, 0.0),
        limits: [look.limit_cos, look.tolerance, look.border, 0.0],
        counts: [0, look.blend, 0, 0],
        ..bytemuck::Zeroable::zeroed()
    };
    let mut count = 0;
    let there = frame.photos.iter().zip(places).enumerate();
    for (index, (chosen, place)) in there.take(MOST_PHOTOS) {
        let Some((map, pixels)) = place else { continue };
        let own = count * PHOTO_VECTORS as usize;
        let map_lens = [chosen.depth.focal, chosen.depth.principal].map(|v| v.to_array());
        let vectors = vectors_of(&chosen.photo, map_lens, look.gains);
        constants.cameras[own..own + vectors.len()].copy_from_slice(&vectors);
        constants.places[2 * count..2 * count + 2].copy_from_slice(&words_of(map, pixels));
        if let Some(compared) = frame.compared
            && compared.list_index as usize == index
        {
            constants.limits[3] = compared.part * width as f32;
            constants.counts[2] = count as u32;
        }
        constants.counts[3] |= u32::from(chosen.photo.stage != 0);
        count += 1;
    }
    constants.counts[0] = count as u32;
    constants
}

fn vectors_of(
    photo: &ProjectedPhoto,
    [map_focal, map_principal]: [[f32; 2]; 2],
    has_gains: bool,
) -> [[f32; 4]; PHOTO_VECTORS as usize] {
    let rows = photo.rotation.transpose();
    let [k0, k1, k2, k3, k4, k5, k6, k7] = photo.coefficients;
    let gain = if has_gains { photo.gain } else { Vec3::ONE };
    [
        vector(rows.x_axis, photo.focal.x),
        vector(rows.y_axis, photo.focal.y),
        vector(rows.z_axis, photo.least_depth),
        vector(photo.center, photo.area),
        [
            photo.principal.x,
            photo.principal.y,
            photo.size.x,
            photo.size.y,
        ],
        vector(gain, photo.stage as f32),
        vector(photo.direction, photo.largest_radius),
        [k0, k1, k2, k3],
        [k4, k5, k6, k7],
        [
            map_focal[0],
            map_focal[1],
            map_principal[0],
            map_principal[1],
        ],
        vector(photo_tint(photo.index).into(), photo.lens as u32 as f32),
    ]
}

fn words_of(map: &MapPlace, pixels: &PixelsPlace) -> [[u32; 4]; 2] {
    let [width, height] = map.size;
    [
        [map.first, width, height, u32::from(pixels.has_mask)],
        [
            pixels.table,
            pixels.size[0],
            pixels.size[1],
            pixels.first << 5 | pixels.count,
        ],
    ]
}
