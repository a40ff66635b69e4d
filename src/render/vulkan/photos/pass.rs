//! Passes `look.photo_weights` and `look.photos`: photographs on whatever surface a frame shows. The first weighs them, group
//! by group beside each other in one image, the second takes the colors of those that weigh most.

use crate::abi::constants::{MOST_FRAME_PHOTOS, PHOTO_GROUP, PHOTO_VECTORS};
use crate::abi::specialization::{
    HAS_CONSENSUS, HAS_LENSES, HAS_MASKS, HAS_SURFACE_NORMALS, MARKS_UNCOVERED, PHOTO_VISIBILITY,
    SHOWS_SOURCE, WEIGHT_DIRECTION, WEIGHT_FORM,
};
use crate::abi::{CompiledShader, ConstantValue, PhotoGroup, PhotoHeader, PhotoTable, shaders};
use crate::gpu::bind::BufferSlice;
use crate::gpu::frame::{FrameRecorder, TargetLoad, UniformBlock};
use crate::gpu::image::{DeviceImage as Target, ImageFormat};
use crate::gpu::pipeline::ShaderPipeline;
use crate::gpu::{Error, Gpu, lock};
use crate::projective::depth_map::PhotoVisibility;
use crate::projective::frame_photos::{FramePhotos, MOST_PHOTOS, photo_tint};
use crate::projective::lens::LensModel;
use crate::projective::look::{PhotoDirection, WeightForm};
use crate::projective::projected::ProjectedPhoto;
use crate::projective::surface_rays::SurfaceRays;
use crate::render::frame_plan::FramePlan;
use crate::render::vulkan::SAMPLES;
use crate::render::vulkan::photos::DevicePhotos;
use crate::render::vulkan::photos::pool::{MapPlace, PhotoPlaces, PixelsPlace};
use crate::render::vulkan::raster_pass::{ScreenDraw, cover, full_screen, screen_description};
use crate::render::vulkan::targets::FrameTargets;
use crate::render::{PhotoDisplay, Settings};
use glam::Vec3;
use std::sync::Arc;

const _: () = assert!(MOST_PHOTOS == MOST_FRAME_PHOTOS as usize);

/// Values of the constants of both pipelines.
#[derive(Debug, Clone, Copy, PartialEq)]
struct PhotoVariant {
    weights: [ConstantValue; 6],
    colors: [ConstantValue; 5],
}

/// The passes with their pictures.
#[derive(Debug)]
pub(crate) struct PhotoPass {
    variant: PhotoVariant,
    weigh: ShaderPipeline,
    color: ShaderPipeline,
    picture: Target,
    /// Weights of four photographs in each pixel of each group.
    weights: Target,
    /// Groups side by side and one below the other that it has room for.
    grid: [u32; 2],
    constants: PhotoBlocks,
    photos: DevicePhotos,
}

/// The uniform blocks of a frame.
#[derive(Debug)]
struct PhotoBlocks {
    header: PhotoHeader,
    groups: Vec<PhotoGroup>,
    table: Box<PhotoTable>,
}

impl PhotoVariant {
    fn of(photos: &FramePhotos, settings: &Settings, has_normals: bool) -> Self {
        let look = &photos.settings;
        let all = || photos.photos.iter();
        let has_lenses = HAS_LENSES.is(all().any(|own| own.photo.lens != LensModel::Pinhole));
        let has_normals = HAS_SURFACE_NORMALS.is(has_normals);
        Self {
            weights: [
                has_lenses,
                has_normals,
                WEIGHT_FORM.is(match look.form {
                    WeightForm::Printed => 0,
                    WeightForm::Mended => 1,
                    WeightForm::Quality => 2,
                    WeightForm::Baked => 3,
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
                HAS_MASKS.is(all().any(|own| own.mask.is_some())),
            ],
            colors: [
                has_lenses,
                has_normals,
                HAS_CONSENSUS.is(look.consensus),
                SHOWS_SOURCE.is(settings.photos == PhotoDisplay::Source),
                MARKS_UNCOVERED.is(settings.marks_uncovered),
            ],
        }
    }
}

/// A pipeline that covers the picture.
fn pipeline(
    gpu: &Arc<Gpu>,
    (name, fragment): (&'static str, &'static CompiledShader),
    constants: &[ConstantValue],
    color: ImageFormat,
) -> Result<ShaderPipeline, Error> {
    let description = screen_description((name, fragment), constants, color);
    ShaderPipeline::new(gpu, &description)
}

/// Columns and rows of groups: few rows, as long as the image is no wider than a device has it.
fn grid_of(gpu: &Gpu, groups: u32, [width, height]: [u32; 2]) -> Result<[u32; 2], Error> {
    let side = gpu.info().max_image_side;
    let columns = (side / width.max(1)).clamp(1, groups.max(1));
    let rows = groups.max(1).div_ceil(columns);
    match rows * height <= side {
        true => Ok([columns, rows]),
        false => Err(Error::Limit {
            what: "the image of weights of photographs, whose sides".into(),
            value: u64::from(rows * height),
            limit: u64::from(side),
        }),
    }
}

impl PhotoPass {
    /// Readies a frame: copies photographs, and makes what is missing in `made` or of another kind.
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
        let variant = PhotoVariant::of(frame, &plan.settings, targets.normal().is_some());
        let color = targets.color();
        let size = [color.width, color.height];
        let groups = (frame.photos.len().min(MOST_PHOTOS) as u32).div_ceil(PHOTO_GROUP);
        let (pipelines, images) = match made {
            Some(made) => (
                (made.variant == variant).then_some((made.weigh, made.color)),
                Some((made.picture, made.weights, made.grid)),
            ),
            None => (None, None),
        };
        let (weigh, draw) = match pipelines {
            Some(made) => made,
            None => {
                let weigh = ("look.photo_weights", &shaders::LOOK_PHOTO_WEIGHTS_FRAG);
                let draw = ("look.photos", &shaders::LOOK_PHOTOS_FRAG);
                (
                    pipeline(gpu, weigh, &variant.weights, SAMPLES)?,
                    pipeline(gpu, draw, &variant.colors, color.format)?,
                )
            }
        };
        let (picture, old) = match images {
            Some((picture, weights, grid)) => (picture, Some((weights, grid))),
            None => {
                let name = "color by photographs";
                (
                    Target::new(gpu, name, color.format, size[0], size[1])?,
                    None,
                )
            }
        };
        let has_room = |grid: &[u32; 2]| grid[0] * grid[1] >= groups;
        let (weights, grid) = match old.filter(|(_, grid)| has_room(grid)) {
            Some(made) => made,
            None => {
                let grid = grid_of(gpu, groups, size)?;
                let [width, height] = [grid[0] * size[0], grid[1] * size[1]];
                let name = "weights of photographs";
                (Target::new(gpu, name, SAMPLES, width, height)?, grid)
            }
        };
        Ok(Self {
            variant,
            weigh,
            color: draw,
            picture,
            weights,
            grid,
            constants: PhotoBlocks::of(frame, &places, &SurfaceRays::of(&plan.view), (size, grid)),
            photos: photos.clone(),
        })
    }

    /// Records the passes, which read colors, depths and normals of the targets.
    ///
    /// # Errors
    /// When the frame has no room for their constants.
    pub(crate) fn record(
        &self,
        frame: &mut FrameRecorder<'_>,
        targets: &FrameTargets,
        plan: &FramePlan,
        constants: UniformBlock,
    ) -> Result<(), Error> {
        let blocks = &self.constants;
        let header = frame.uniform(&blocks.header)?;
        let groups: Vec<UniformBlock> = (blocks.groups.iter())
            .map(|group| frame.uniform(group))
            .collect::<Result<_, Error>>()?;
        let table = frame.uniform(&*blocks.table)?;
        let pool = lock(&self.photos.pool);
        let normals = targets.normal().unwrap_or(targets.color());
        let surface = [targets.color(), targets.depth(), normals];
        let storage = [BufferSlice::whole(pool.buffer())];
        let [left, top, right, bottom] = plan.context.rect_px;
        let pass = (frame.pass("look.photo_weights"))
            .color(&self.weights, TargetLoad::Clear([0.0; 4]))
            .fragment_storage(pool.buffer());
        let pass = surface.iter().fold(pass, |pass, image| pass.sampled(image));
        pass.draw_whole(|draw| {
            for (group, block) in blocks.groups.iter().zip(&groups) {
                let uniforms = [constants, header, *block];
                draw.bind_storage(&self.weigh, &uniforms, &surface, &storage);
                let [x, y, ..] = group.spot;
                cover(draw, &[[left + x, top + y, right + x, bottom + y]]);
            }
        });
        let [r, g, b] = plan.context.background;
        let pass = (frame.pass("look.photos"))
            .color(&self.picture, TargetLoad::Clear([r, g, b, 0.0]))
            .fragment_storage(pool.buffer());
        let [color, depth, normals] = surface;
        let screen = ScreenDraw {
            pipeline: &self.color,
            uniforms: &[constants, header, table],
            images: &[color, depth, normals, &self.weights],
            storage: &storage,
        };
        let rect_px = match self.photos.frame.compared {
            // It reaches beyond the surface.
            Some(_) => plan.context.whole_px(),
            None => plan.context.rect_px,
        };
        full_screen(pass, &screen, rect_px);
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

impl PhotoBlocks {
    /// What shaders know of the photographs of a frame that are there.
    fn of(
        frame: &FramePhotos,
        places: &PhotoPlaces,
        rays: &SurfaceRays,
        (size, grid): ([u32; 2], [u32; 2]),
    ) -> Self {
        let look = &frame.settings;
        let mut header = PhotoHeader {
            start: vector(rays.start, f32::from(u8::from(rays.is_perspective))),
            towards: vector(rays.towards, 0.0),
            right: vector(rays.right, 0.0),
            down: vector(rays.down, 0.0),
            direction: vector(frame.direction, 0.0),
            limits: [look.limit_cos, look.tolerance, look.border, 0.0],
            counts: [0, look.blend, 0, grid[0]],
            size: [size[0], size[1], 0, 0],
        };
        let mut table: Box<PhotoTable> = Box::new(bytemuck::Zeroable::zeroed());
        let vectors = PHOTO_VECTORS as usize;
        let mut count = 0;
        let there = frame.photos.iter().zip(places).enumerate();
        for (index, (chosen, place)) in there.take(MOST_PHOTOS) {
            let Some((map, pixels)) = place else { continue };
            let map_lens = [chosen.depth.focal, chosen.depth.principal].map(|v| v.to_array());
            table.cameras[count * vectors..(count + 1) * vectors].copy_from_slice(&vectors_of(
                &chosen.photo,
                map_lens,
                look.gains,
            ));
            table.places[2 * count..2 * count + 2].copy_from_slice(&words_of(map, pixels));
            if let Some(compared) = frame.compared
                && compared.list_index as usize == index
            {
                header.limits[3] = compared.part * size[0] as f32;
                header.counts[2] = count as u32;
            }
            count += 1;
        }
        header.counts[0] = count as u32;
        let in_group = PHOTO_GROUP as usize;
        let group = |index: usize| {
            let mut group: PhotoGroup = bytemuck::Zeroable::zeroed();
            let first = index * in_group;
            let cameras = &table.cameras[first * vectors..(first + in_group) * vectors];
            group.cameras.copy_from_slice(cameras);
            (group.places).copy_from_slice(&table.places[2 * first..2 * (first + in_group)]);
            let [column, row] = [index as u32 % grid[0], index as u32 / grid[0]];
            let there = (count - first).min(in_group) as u32;
            group.spot = [column * size[0], row * size[1], there, 0];
            group
        };
        let groups = (0..count.div_ceil(in_group)).map(group).collect();
        Self {
            header,
            groups,
            table,
        }
    }
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
