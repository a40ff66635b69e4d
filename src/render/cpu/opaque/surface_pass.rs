//! Pictures that hold more than colors of eight bits in the headlight: first the number of what is nearest in each pixel, then
//! what that looks like, pixel by pixel.

use crate::abi::Splat;
use crate::pack::parallel;
use crate::render::cpu::float_planes::word_of;
use crate::render::cpu::frame_shading::{FrameShading, ShadedPoint};
use crate::render::cpu::opaque::bands::{
    BAND_PX, KnownSplats, OpaqueSplatList, SPLAT_BIT, draw_by,
};
use crate::render::cpu::opaque::triangles::draw_numbers;
use crate::render::cpu::opaque::{
    Frame, ListedSplats, ShownRectangle, SplatPlaces, SplatScreen, SplatShape,
};
use crate::render::cpu::triangles::{CutTriangles, FaceSurface, MeshVertices, NumberedFace};
use fearless_simd::Level;

/// What is drawn: triangles, then splats.
#[derive(Clone, Copy)]
pub(crate) struct SurfaceList<'a> {
    pub(crate) triangles: &'a CutTriangles,
    /// Corners of the triangles.
    pub(crate) meshes: MeshVertices<'a>,
    pub(crate) splats: &'a [Splat],
    /// What splats look like.
    pub(crate) look: SplatShape,
    /// Triangles that cover few pixels, as squares of one.
    pub(crate) samples: &'a [Splat],
    pub(crate) shading: &'a FrameShading,
}

/// Floats of the rectangle, row by row; empty where nobody asks for them. What shows nothing keeps what it holds.
#[derive(Debug)]
pub(crate) struct SurfacePlanes<'a> {
    /// Red, green, blue and coverage.
    pub(crate) values: &'a mut [[f32; 4]],
    /// Unit, with the axes of model and world; or zero.
    pub(crate) normals: &'a mut [[f32; 3]],
}

/// Draws a list. The picture becomes that, whatever it held.
///
/// # Panics
/// When picture or planes are smaller than the screen, or the triangles were set up for another part of the picture.
pub(crate) fn draw_surfaces(
    list: SurfaceList<'_>,
    frame: Frame<'_>,
    places: &mut SplatPlaces,
    mut picture: ShownRectangle<'_>,
    planes: SurfacePlanes<'_>,
) {
    let (screen, light) = frame;
    picture.is_begun = list.triangles.count() > 0;
    if picture.is_begun {
        let picture = picture.again();
        draw_numbers(list.triangles, screen, light.background(), picture);
    }
    let parts = list.splats.chunks(parallel::PART);
    let parts = parts.map(|part| (ListedSplats::Places(part), part.len()));
    let splats = OpaqueSplatList {
        parts: parts.collect(),
        look: list.look,
        samples: list.samples,
    };
    let target = (places, picture.again());
    draw_by(Level::new(), splats, frame, KnownSplats::Numbers, target);
    shade(&list, screen, picture, planes);
}

/// Numbers become colors, and floats where they are asked for.
fn shade(
    list: &SurfaceList<'_>,
    screen: &SplatScreen,
    picture: ShownRectangle<'_>,
    planes: SurfacePlanes<'_>,
) {
    let width = screen.width();
    if width == 0 {
        return;
    }
    let [left, top, ..] = screen.rect_px();
    let mut values = planes.values.chunks_mut(BAND_PX * width);
    let mut normals = planes.normals.chunks_mut(BAND_PX * width);
    let bands = picture.bands(screen).enumerate().map(|(number, picture)| {
        let planes = SurfacePlanes {
            values: values.next().unwrap_or_default(),
            normals: normals.next().unwrap_or_default(),
        };
        (top + (number * BAND_PX) as u32, picture, planes)
    });
    let bands: Vec<_> = bands.collect();
    // A pixel takes about as long as the record of a list.
    parallel::share(
        screen.pixels(),
        bands.into_iter(),
        |(first, mut picture, planes)| {
            let mut shader = PixelShader {
                list,
                word: 0,
                last: SeenSurface::Nothing,
            };
            for (row, (colors, depths)) in picture.rows(width).enumerate() {
                let y = first + row as u32;
                for (column, (color, &depth)) in colors.iter_mut().zip(&*depths).enumerate() {
                    if depth == 0.0 {
                        continue;
                    }
                    let point = shader.point(*color, [left + column as u32, y], depth);
                    let value = point.color.extend(1.0);
                    *color = word_of(value);
                    let at = row * width + column;
                    if let Some(own) = planes.values.get_mut(at) {
                        *own = value.to_array();
                    }
                    if let Some(own) = planes.normals.get_mut(at) {
                        *own = point.normal.to_array();
                    }
                }
            }
        },
    );
}

/// Shades pixels. Neighbors often show the same.
struct PixelShader<'a> {
    list: &'a SurfaceList<'a>,
    /// What the last pixel held.
    word: u32,
    last: SeenSurface<'a>,
}

/// What a pixel shows, as far as it is the same in others.
enum SeenSurface<'a> {
    Nothing,
    Splat(ShadedPoint),
    Triangle(NumberedFace<'a>, FaceSurface<'a>),
}

impl PixelShader<'_> {
    /// What a pixel shows that holds this number, at a depth.
    #[inline]
    fn point(&mut self, word: u32, pixel: [u32; 2], depth: f32) -> ShadedPoint {
        if word != self.word || matches!(self.last, SeenSurface::Nothing) {
            self.word = word;
            self.last = self.seen(word);
        }
        match (&self.last, self.list.triangles.light()) {
            (SeenSurface::Splat(point), _) => *point,
            (SeenSurface::Triangle(found, surface), Some(light)) => {
                light.point_at(surface, &found.face.place_at(pixel, depth))
            }
            _ => ShadedPoint::default(),
        }
    }
}

impl<'a> PixelShader<'a> {
    fn seen(&self, word: u32) -> SeenSurface<'a> {
        let list = self.list;
        if word & SPLAT_BIT == 0 {
            let number = (!word & !SPLAT_BIT) as usize;
            let (splats, shading) = (list.splats, list.shading);
            let point = match (splats.get(number), number.checked_sub(splats.len())) {
                (Some(splat), _) => shading.of_splat(splat),
                (None, Some(sample)) => shading.of_sample(&list.samples[sample]),
                (None, None) => ShadedPoint::default(),
            };
            return SeenSurface::Splat(point);
        }
        let Some(light) = list.triangles.light() else {
            return SeenSurface::Nothing;
        };
        match list.triangles.numbered(word & !SPLAT_BIT) {
            Some(found) => {
                let surface = FaceSurface::of(found.face, found.part, list.meshes, light);
                SeenSurface::Triangle(found, surface)
            }
            None => SeenSurface::Nothing,
        }
    }
}
