//! Facts of what is drawn, found once: of each model, and of several that are drawn together.

use crate::abi::OrientedPolygon;
use crate::cut::ZeroAreaSet;
use crate::oriented::resample::{SampleBounds, SampleChoice, SampleError, samples_of};
use crate::oriented::surface::WeldedSurface;
use crate::patches::{PatchCut, ResidentPatches};
use crate::progress::{Progress, SilentProgress};
use crate::render::vertex_looks::looks_of;
use crate::tree;
use crate::tree::{Model, ModelKind};
use glam::{DVec3, Vec3};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// Number of models whose facts were asked for in this process.
static MODELS: AtomicU64 = AtomicU64::new(0);

/// Facts of one model; they belong to no other.
#[derive(Debug)]
pub struct ModelFacts {
    id: u64,
    has_colors: bool,
    drawn: DrawnFacts,
    undrawn: OnceLock<ZeroAreaSet>,
    patches: OnceLock<ResidentPatches>,
    bounds: OnceLock<SampleBounds>,
    /// Even splats by the last rules that were asked for.
    even: Mutex<Option<EvenSplats>>,
}

/// Even splats of a model, or why there are none.
#[derive(Debug, Clone)]
struct EvenSplats {
    choice: SampleChoice,
    crease: f64,
    made: Result<Arc<[OrientedPolygon]>, SampleError>,
}

/// A model to be drawn, with the facts that were found of it.
#[derive(Debug, Clone, Copy)]
pub struct FactedModel<'a> {
    /// The model.
    pub model: &'a Model,
    /// Facts of this model.
    pub facts: &'a ModelFacts,
    /// Cut of the model, where that was chosen beside the frame: of a page of a paged file.
    pub cut: Option<&'a PatchCut>,
}

/// Facts on which a plan rests, of a model or of several that are drawn together; lengths and places in model space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DrawnFacts {
    /// Kind of the leaves. Parts of different kinds are together [`ModelKind::Points`]: nothing holds of them that holds of
    /// triangles alone.
    pub kind: ModelKind,
    /// All surfaces are closed.
    pub is_closed: bool,
    /// Points without normals.
    pub lacks_normals: bool,
    /// Smallest corner of the axis-aligned box.
    pub min: Vec3,
    /// Largest corner of that box.
    pub max: Vec3,
    /// Center of a sphere around everything.
    pub orbit_center: Vec3,
    /// Radius of that sphere.
    pub orbit_radius: f32,
    /// World position of the model-space zero.
    pub origin: DVec3,
    /// Triangles show textures.
    pub has_textures: bool,
    /// Median radius of the points of a cloud; 0 without any, and where it is not known.
    pub point_radius: f32,
}

/// Number of points, at most, that a median radius is taken of.
const MOST_RADII: usize = 1023;

/// Median radius of the points of a cloud; 0 of anything else.
pub(crate) fn point_radius(model: &Model) -> f32 {
    let leaves = &model.tree.leaves;
    if !model.kind().is_points() || leaves.is_empty() {
        return 0.0;
    }
    let step = leaves.len().div_ceil(MOST_RADII);
    let mut radii: Vec<f32> = leaves
        .iter()
        .step_by(step)
        .map(|leaf| leaf.radius)
        .collect();
    let middle = radii.len() / 2;
    *radii.select_nth_unstable_by(middle, f32::total_cmp).1
}

impl From<&Model> for DrawnFacts {
    fn from(model: &Model) -> Self {
        Self {
            kind: model.kind(),
            is_closed: model.is_closed,
            lacks_normals: model.lacks_normals(),
            min: model.min,
            max: model.max,
            orbit_center: model.orbit_center,
            orbit_radius: model.orbit_radius,
            origin: model.origin,
            has_textures: model.textures.is_some(),
            point_radius: point_radius(model),
        }
    }
}

impl DrawnFacts {
    /// Facts of both together; empty models add nothing.
    fn joined(self, other: Self) -> Self {
        match (self.kind, other.kind) {
            (ModelKind::Empty, _) => return other,
            (_, ModelKind::Empty) => return self,
            _ => {}
        }
        let (min, max) = (self.min.min(other.min), self.max.max(other.max));
        let orbit_center = 0.5 * (min + max);
        let reach = |part: Self| part.orbit_center.distance(orbit_center) + part.orbit_radius;
        Self {
            kind: match self.kind == other.kind {
                true => self.kind,
                false => ModelKind::Points,
            },
            is_closed: self.is_closed && other.is_closed,
            lacks_normals: self.lacks_normals && other.lacks_normals,
            min,
            max,
            orbit_center,
            // The sphere around the box contains everything too.
            orbit_radius: reach(self).max(reach(other)).min(0.5 * min.distance(max)),
            origin: self.origin,
            has_textures: self.has_textures || other.has_textures,
            point_radius: self.point_radius.max(other.point_radius),
        }
    }
}

impl ModelFacts {
    /// Looks at the vertices of a model.
    pub fn of(model: &Model) -> Self {
        Self {
            id: MODELS.fetch_add(1, Ordering::Relaxed),
            has_colors: model.vertices.iter().any(|v| v.color != [255; 4]),
            drawn: model.into(),
            undrawn: OnceLock::new(),
            patches: OnceLock::new(),
            bounds: OnceLock::new(),
            even: Mutex::new(None),
        }
    }

    /// Facts of a page of a paged file, whose frames rest on facts of the whole file; `has_colors` of the file too.
    pub(crate) fn of_page(drawn: DrawnFacts, has_colors: bool) -> Self {
        Self {
            id: MODELS.fetch_add(1, Ordering::Relaxed),
            has_colors,
            drawn,
            undrawn: OnceLock::new(),
            patches: OnceLock::new(),
            bounds: OnceLock::new(),
            even: Mutex::new(None),
        }
    }

    /// Facts of the same model with another median radius of points.
    pub(crate) fn with_point_radius(&self, point_radius: f32) -> Self {
        let drawn = DrawnFacts {
            point_radius,
            ..self.drawn
        };
        Self {
            id: self.id,
            ..Self::of_page(drawn, self.has_colors)
        }
    }

    /// Number that no other model of this process has or had.
    pub(crate) fn id(&self) -> u64 {
        self.id
    }

    /// Facts on which a plan rests.
    pub(crate) fn drawn(&self) -> DrawnFacts {
        self.drawn
    }

    /// Nodes and leaves without area; found at the first call.
    pub(crate) fn undrawn(&self, model: &Model) -> &ZeroAreaSet {
        self.undrawn.get_or_init(|| ZeroAreaSet::new(model))
    }

    /// Nodes as polygons; made at the first call, in some seconds of processor time for each million triangles.
    pub(crate) fn patches(&self, model: &Model) -> &ResidentPatches {
        // Nobody cancels.
        let made = || ResidentPatches::build(model, &SilentProgress).unwrap_or_default();
        self.patches.get_or_init(made)
    }

    /// Bounds of the number of even splats; found at the first call.
    pub(crate) fn sample_bounds(&self, model: &Model) -> &SampleBounds {
        let position = |v: u32| model.vertices.get(v as usize).map(|v| v.position);
        let found = || SampleBounds::of(position, &model.triangles);
        self.bounds.get_or_init(found)
    }

    /// Splats that lie evenly on a model; made unless they were those of the last call.
    ///
    /// # Errors
    /// Too small a spacing, and [`SampleError::Cancelled`].
    pub(crate) fn even_splats(
        &self,
        model: &Model,
        choice: &SampleChoice,
        crease: f64,
        progress: &dyn Progress,
    ) -> Result<Arc<[OrientedPolygon]>, SampleError> {
        let mut even = self.even.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(last) = &*even
            && (last.choice, last.crease) == (*choice, crease)
        {
            return last.made.clone();
        }
        let rules = self.sample_bounds(model).rules(choice, crease);
        let made = rules.and_then(|rules| {
            let positions: Vec<_> = model.vertices.iter().map(|v| v.position).collect();
            let surface = WeldedSurface::new(&positions, &model.triangles);
            samples_of(&surface, &looks_of(model), &rules, progress).map(Arc::from)
        });
        if made != Err(SampleError::Cancelled) {
            *even = Some(EvenSplats {
                choice: *choice,
                crease,
                made: made.clone(),
            });
        }
        made
    }

    /// Tells whether patches are there.
    pub(crate) fn has_patches(&self) -> bool {
        self.patches.get().is_some()
    }

    /// Makes them unless they are there.
    ///
    /// # Errors
    /// [`tree::Error::Cancelled`].
    pub(crate) fn build_patches(
        &self,
        model: &Model,
        progress: &dyn Progress,
    ) -> Result<(), tree::Error> {
        if !self.has_patches() {
            let made = ResidentPatches::build(model, progress)?;
            // Another thread may have been sooner; both made the same.
            self.patches.get_or_init(|| made);
        }
        Ok(())
    }
}

/// Models that are shown, with facts that a scene shares.
pub(crate) fn facted<'a>(shown: &'a [(&'a Model, Arc<ModelFacts>)]) -> Vec<FactedModel<'a>> {
    let of = |(model, facts): &'a (&'a Model, Arc<ModelFacts>)| FactedModel {
        model,
        facts,
        cut: None,
    };
    shown.iter().map(of).collect()
}

/// Models that a frame draws together, in one model space. Each is a part.
#[derive(Debug, Clone, Copy)]
pub struct DrawnParts<'a> {
    parts: &'a [FactedModel<'a>],
    /// Stands for the cuts that were chosen beside the frame; 0 where none was.
    generation: u64,
}

impl<'a> DrawnParts<'a> {
    /// Parts with a common [`Model::origin`].
    pub fn new(parts: &'a [FactedModel<'a>]) -> Self {
        debug_assert!(
            parts
                .windows(2)
                .all(|two| two[0].model.origin == two[1].model.origin),
            "parts share one space"
        );
        Self {
            parts,
            generation: 0,
        }
    }

    /// The same parts, some of whose cuts were chosen beside the frame; `generation` (not 0) stands for those cuts, and
    /// others have another.
    #[must_use]
    pub(crate) fn with_generation(self, generation: u64) -> Self {
        Self { generation, ..self }
    }

    /// The parts, in their order.
    pub fn iter(self) -> impl ExactSizeIterator<Item = FactedModel<'a>> {
        self.parts.iter().copied()
    }

    /// Number of parts.
    pub fn count(self) -> usize {
        self.parts.len()
    }

    /// The only part; `None` where there are several or none.
    pub fn single(self) -> Option<FactedModel<'a>> {
        match self.parts {
            [part] if part.cut.is_none() => Some(*part),
            _ => None,
        }
    }

    /// A number that stands for these parts: that of the model where there is one, else a hash of those of all.
    pub(crate) fn id(self) -> u64 {
        match self.parts {
            [part] if part.cut.is_none() => part.facts.id,
            // FNV-1a over the numbers, in the upper half of all: models are counted from 0.
            parts => {
                let ids = parts.iter().map(|part| part.facts.id);
                let join = |hash: u64, id: u64| (hash ^ id).wrapping_mul(0x0000_0100_0000_01b3);
                ids.chain([self.generation])
                    .fold(0xcbf2_9ce4_8422_2325, join)
                    | 1 << 63
            }
        }
    }

    /// Facts of all parts together; those of an empty model where there are none.
    pub fn facts(self) -> DrawnFacts {
        let all = self.parts.iter().map(|part| part.facts.drawn);
        all.reduce(DrawnFacts::joined)
            .unwrap_or_else(|| DrawnFacts::from(&Model::default()))
    }

    /// Tells whether some vertex has a color other than white, or no normal.
    pub(crate) fn has_colors(self) -> bool {
        self.parts.iter().any(|part| part.facts.has_colors)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn facts(kind: ModelKind, x: f32) -> DrawnFacts {
        DrawnFacts {
            kind,
            is_closed: true,
            lacks_normals: kind.is_points(),
            min: Vec3::new(x - 1.0, -1.0, -1.0),
            max: Vec3::new(x + 1.0, 1.0, 1.0),
            orbit_center: Vec3::X * x,
            orbit_radius: 1.0,
            ..DrawnFacts::from(&Model::default())
        }
    }

    #[test]
    fn parts_together_are_as_little_as_any_of_them() {
        let (left, right) = (
            facts(ModelKind::Surface, -3.0),
            facts(ModelKind::Surface, 3.0),
        );
        let both = left.joined(right);
        assert_eq!((both.kind, both.is_closed), (ModelKind::Surface, true));
        assert_eq!((both.min.x, both.max.x), (-4.0, 4.0));
        assert_eq!((both.orbit_center, both.orbit_radius), (Vec3::ZERO, 4.0));
        let open = DrawnFacts {
            is_closed: false,
            ..right
        };
        assert!(!left.joined(open).is_closed);
        let points = facts(ModelKind::Points, 0.0);
        let mixed = left.joined(points);
        assert_eq!(
            (mixed.kind, mixed.lacks_normals),
            (ModelKind::Points, false)
        );
        assert!(points.joined(points).lacks_normals);
        let nothing = DrawnFacts::from(&Model::default());
        assert_eq!(left.joined(nothing), left);
        assert_eq!(nothing.joined(left), left);
    }

    #[test]
    fn parts_have_a_number_of_their_own() {
        let models = [Model::default(), Model::default()];
        let found = models.each_ref().map(ModelFacts::of);
        let part = |i: usize| FactedModel {
            model: &models[i],
            facts: &found[i],
            cut: None,
        };
        let id = |parts: &[FactedModel<'_>]| DrawnParts::new(parts).id();
        let all = [
            id(&[]),
            id(&[part(0)]),
            id(&[part(1)]),
            id(&[part(0), part(1)]),
            id(&[part(1), part(0)]),
        ];
        for (i, a) in all.iter().enumerate() {
            assert!(all[..i].iter().all(|b| a != b), "{all:?}");
        }
        assert_eq!(id(&[part(0)]), found[0].id());
    }
}
