//! Builds the tree over a mesh or a point cloud.
//!
//! Sources: Benda, *Point Based Rendering*, section 3.2.1 (halving at the median along the longest axis, up to four
//! children, bounding spheres); Rusinkiewicz and Levoy, *QSplat*, section 2 (attributes as averages of the children's).
//! The work, in order: centers of the leaves' spheres; the shape ([`super::shape`]); the leaves' places in it
//! ([`super::partition`]); vertices in order of use ([`super::order`]); nodes upward ([`super::blocks`]).

use super::closed::ClosedEvidence;
use super::flat_partition::FlatPartition;
use super::grow::{TreeGrowth, VertexExtent, level_starts_of, links};
use super::partition::TreePartition;
use super::shape::TreeShape;
use super::sort_item::SortItem;
use super::spacing::{self, CloudNormals, CloudSpacing};
use super::{
    AlignedRecords, Error, Leaf, Model, ModelTextures, Tree, framed, order, point_normals, textures,
};
use crate::math::sphere;
use crate::mesh::creases;
use crate::mesh::normals::{self, NormalWeighting};
use crate::mesh::{self, Mesh};
use crate::progress::Progress;
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// Choices of the build.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct BuildOptions {
    /// Angle beyond which an edge of a mesh without normals is sharp, degrees ([`creases::split`]); `None` smooths all.
    pub crease_degrees: Option<f32>,
    /// Leave the model-space zero where the mesh has it, however far that is.
    pub keeps_origin: bool,
    /// How the triangles of a node are divided among its children.
    pub split: SplitRule,
    /// Which normals the points of a cloud have.
    pub point_normals: PointNormals,
}

/// Which normals the points of a cloud have.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum PointNormals {
    /// Normals of the file, where it has some.
    #[default]
    File,
    /// Normals of the file; where it has none, those of planes through the neighbors of a point, if these make a surface.
    Estimate,
    /// None.
    None,
}

/// By which key the triangles of a node are halved; the sizes of the halves are prescribed. Points are always divided along the
/// longest axis.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum SplitRule {
    /// Along the longest axis of the box of their centers (Benda).
    #[default]
    Longest,
    /// By the axis, of places or of normals, that leaves both halves flattest, for patches; building takes about three times as
    /// long.
    Flat,
}

/// Builds the tree. Colors and normals of nodes are means weighted by area; colors are averaged as the values they are
/// (value / 255, no decoding), as pictures are. Vertex normals that are missing or zero are computed (area-weighted, vertices
/// on sharp edges split) if the mesh has triangles; a cloud without normals stays without, unless they are to be estimated
/// ([`PointNormals`]).
///
/// What lies far from the model-space zero is moved to it first ([`mesh::recenter`]); the world positions stay.
///
/// The result depends on the mesh alone, not on the number of threads. O(n log n); about 0.2 microseconds a triangle on two
/// cores. At its peak it holds less than the mesh and the result together.
///
/// No leaves give an empty model (its vertices are all unused); a single one gives a tree without nodes.
///
/// # Errors
///
/// Too many leaves or vertices for 32-bit indices; a position that is not finite or a corner that names no vertex;
/// cancelled.
pub fn build(mesh: Mesh, options: &BuildOptions, progress: &dyn Progress) -> Result<Model, Error> {
    let parts = BuildParts {
        radii: None,
        part: None,
        keeps_order: false,
    };
    Ok(build_around(mesh, options, parts, progress)?.model)
}

/// Builds as [`build`], and tells where the vertices came from: the index in the mesh of each vertex of the model. Copies of
/// vertices, made along sharp edges, have indices beyond those of the mesh; points of a cloud have none.
///
/// # Errors
/// As [`build`].
pub fn build_ordered(
    mesh: Mesh,
    options: &BuildOptions,
    progress: &dyn Progress,
) -> Result<(Model, Vec<u32>), Error> {
    let parts = BuildParts {
        radii: None,
        part: None,
        keeps_order: true,
    };
    let grown = build_around(mesh, options, parts, progress)?;
    Ok((grown.model, grown.old_of_new))
}

/// Builds the tree of a cloud whose points have radii of their own, in the order of the positions, instead of measured
/// ones. Negative radii, and those that are no numbers, count as 0. All else as [`build`].
///
/// # Errors
///
/// As [`build`]; a mesh with triangles, or not one radius for each point.
pub fn build_with_radii(
    mesh: Mesh,
    radii: &[f32],
    progress: &dyn Progress,
) -> Result<Model, Error> {
    if !mesh.triangles.is_empty() || radii.len() != mesh.positions.len() {
        return Err(Error::Mismatch {
            what: "radii",
            count: radii.len(),
            vertices: mesh.positions.len(),
        });
    }
    let parts = BuildParts {
        radii: Some(radii),
        part: None,
        keeps_order: false,
    };
    Ok(build_around(mesh, &BuildOptions::default(), parts, progress)?.model)
}

/// What is known of a tree before it is built.
#[derive(Debug, Clone, Copy)]
pub(super) struct BuildParts<'a> {
    /// Radii of a cloud's points.
    pub(super) radii: Option<&'a [f32]>,
    /// The whole that the model is a part of.
    pub(super) part: Option<PartPlace>,
    /// Where vertices came from is told ([`GrownModel::old_of_new`]).
    pub(super) keeps_order: bool,
}

/// What a part of a model has in common with the others.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PartPlace {
    /// Levels of nodes.
    pub(crate) depth: usize,
    /// A place near the whole model, from which its volume is measured.
    pub(crate) center: DVec3,
}

/// The shape of a tree, of the depth that a part must have.
///
/// # Errors
/// No tree of that depth has so many leaves.
pub(super) fn shape_of(count: usize, part: Option<PartPlace>) -> Result<TreeShape, Error> {
    match part {
        None => Ok(TreeShape::new(count as u32)),
        Some(part) => TreeShape::with_depth(count as u32, part.depth).ok_or(Error::TooLarge {
            what: "leaves in a part",
            count,
            limit: 1usize.checked_shl(2 * part.depth as u32).unwrap_or(LIMIT),
        }),
    }
}

/// Builds as [`build`], by what is known already. Returns what was found of the surface, too.
pub(super) fn build_around(
    mut mesh: Mesh,
    options: &BuildOptions,
    parts: BuildParts<'_>,
    progress: &dyn Progress,
) -> Result<GrownModel, Error> {
    let BuildParts {
        radii,
        part,
        keeps_order,
    } = parts;
    let is_cloud = mesh.is_cloud();
    if is_cloud && options.point_normals == PointNormals::None {
        mesh.normals = Vec::new();
    }
    let (what, count) = if is_cloud {
        ("points", mesh.positions.len())
    } else {
        ("triangles", mesh.triangles.len())
    };
    for (what, count) in [(what, count), ("vertices", mesh.positions.len())] {
        if count > LIMIT {
            return Err(Error::TooLarge {
                what,
                count,
                limit: LIMIT,
            });
        }
    }
    for (what, length) in [
        ("normals", mesh.normals.len()),
        ("colors", mesh.colors.len()),
    ] {
        if length != 0 && length != mesh.positions.len() {
            return Err(Error::Mismatch {
                what,
                count: length,
                vertices: mesh.positions.len(),
            });
        }
    }
    let stop = AtomicBool::new(false);
    let advance = |amount: u64| {
        progress.advance(amount);
        if progress.is_cancelled() {
            stop.store(true, Ordering::Relaxed);
        }
    };
    let check_stop = || {
        if stop.load(Ordering::Relaxed) || progress.is_cancelled() {
            Err(Error::Cancelled)
        } else {
            Ok(())
        }
    };

    // The leaves travel in the memory in which they will stay.
    progress.stage("bounding triangles", count as u64);
    if !options.keeps_origin {
        mesh::recenter(&mut mesh);
    }
    let mut leaves = AlignedRecords::<Leaf>::zeroed(count);
    leaf_centers(&mesh, bytemuck::cast_slice_mut(&mut leaves))?;
    progress.advance(count as u64);
    check_stop()?;

    progress.stage("ordering", count as u64);
    let shape = shape_of(count, part)?;
    {
        let mut spare = AlignedRecords::<SortItem>::zeroed(count);
        let items = bytemuck::cast_slice_mut(&mut leaves);
        let shape = TreePartition {
            shape: &shape,
            stop: &stop,
            placed: &advance,
        };
        if options.split == SplitRule::Flat && !is_cloud {
            let mesh = &mesh;
            FlatPartition { shape, mesh }.run(items, &mut spare);
        } else {
            shape.run(items, &mut spare);
        }
    }
    check_stop()?;
    let scanners = std::mem::take(&mut mesh.scanners);
    let model_zero = mesh.origin;

    progress.stage("arranging vertices", count as u64);
    let level_starts = level_starts_of(&shape);
    // Both go through long lists one by one for most of their time.
    let (arranged, (parents, first_leaf)) = rayon::join(
        || arrange(mesh, &leaves, options),
        || links(&shape, &level_starts),
    );
    let radii: Option<Vec<f32>> = radii.map(|radii| {
        let items: &[SortItem] = bytemuck::cast_slice(&leaves);
        // `max` also replaces what is no number.
        let own = |item: &SortItem| radii[item.index as usize].max(0.0);
        items.iter().map(own).collect()
    });
    let ArrangedMesh {
        mut model,
        mut normals,
        mut old_of_new,
    } = arranged?;
    if !keeps_order {
        old_of_new = Vec::new();
    }
    progress.advance(count as u64);
    check_stop()?;

    if is_cloud {
        progress.stage("measuring spacing", count as u64);
        let is_estimated = options.point_normals == PointNormals::Estimate;
        let with_normals = is_estimated && normals.is_empty();
        let points: Vec<Vec3> = leaves.iter().map(|leaf| leaf.center).collect();
        let cloud_normals = match (normals.is_empty(), with_normals) {
            (false, _) => CloudNormals::Given(&normals),
            (true, true) => CloudNormals::Wanted,
            (true, false) => CloudNormals::Unwanted,
        };
        let mut found = match (&radii, with_normals) {
            (Some(_), false) => CloudSpacing::default(),
            _ => spacing::measure(&shape, &points, cloud_normals, (&stop, &advance)),
        };
        found.radii = radii.unwrap_or(found.radii);
        check_stop()?;
        if with_normals {
            normals = found.normals;
            point_normals::orient(&shape, &points, &found.radii, &mut normals);
            if scanners.is_any_known() {
                let items: &[SortItem] = bytemuck::cast_slice(&leaves);
                point_normals::turn_to_scanners(&points, &mut normals, |point| {
                    let scanner = scanners.of_point(items[point].index as usize)?;
                    Some((scanner - model_zero).as_vec3())
                });
            }
            point_normals::give(&mut model.vertices, &normals);
        }
        for (leaf, radius) in leaves.iter_mut().zip(found.radii) {
            leaf.radius = radius;
        }
    }
    progress.stage("building nodes", count as u64);
    let growth = TreeGrowth {
        shape: &shape,
        level_starts,
        links: (parents, first_leaf),
        normals,
        origin: part.map_or(model.orbit_center.as_dvec3(), |part| part.center),
        stop: &stop,
        done: &advance,
    };
    let evidence = growth.grow(&mut model, leaves);
    check_stop()?;
    model.is_closed = !is_cloud && evidence.is_closed();
    Ok(GrownModel {
        model,
        evidence,
        old_of_new,
    })
}

/// Most leaves and most vertices: indices have 32 bits, and the sentinel of an unseen vertex takes one.
const LIMIT: usize = u32::MAX as usize - 1;

/// Centers of the leaves' spheres, in file order; checks the mesh on the way.
pub(super) fn leaf_centers(mesh: &Mesh, items: &mut [SortItem]) -> Result<(), Error> {
    const CHUNK: usize = 4096;
    if mesh.triangles.is_empty() {
        if let Some(vertex) = mesh.positions.iter().position(|p| !p.is_finite()) {
            return Err(Error::NotFinite { vertex });
        }
        for (index, (item, &center)) in items.iter_mut().zip(&mesh.positions).enumerate() {
            *item = SortItem {
                center,
                index: index as u32,
            };
        }
        return Ok(());
    }
    // The first fault in file order, whoever meets it first.
    let fault = AtomicUsize::new(usize::MAX);
    items
        .par_chunks_mut(CHUNK)
        .zip(mesh.triangles.par_chunks(CHUNK))
        .enumerate()
        .for_each(|(chunk, (items, triangles))| {
            for (offset, (item, triangle)) in items.iter_mut().zip(triangles).enumerate() {
                let index = chunk * CHUNK + offset;
                let corners = triangle.map(|corner| {
                    mesh.positions
                        .get(corner as usize)
                        .copied()
                        .unwrap_or(Vec3::NAN)
                });
                if !corners.iter().all(|corner| corner.is_finite()) {
                    fault.fetch_min(index, Ordering::Relaxed);
                }
                let center = sphere::triangle_center(corners.map(|p| p.as_dvec3())).as_vec3();
                *item = SortItem {
                    center,
                    index: index as u32,
                };
            }
        });
    let triangle = fault.into_inner();
    if triangle == usize::MAX {
        return Ok(());
    }
    let corners = mesh.triangles[triangle];
    Err(
        match corners
            .into_iter()
            .find(|&corner| corner as usize >= mesh.positions.len())
        {
            Some(corner) => Error::BadCorner {
                triangle,
                corner,
                vertices: mesh.positions.len(),
            },
            None => Error::NotFinite {
                vertex: corners
                    .into_iter()
                    .find(|&c| !mesh.positions[c as usize].is_finite())
                    .unwrap_or(corners[0]) as usize,
            },
        },
    )
}

/// A model without its tree, the normals of its vertices in full, and where its vertices came from.
struct ArrangedMesh {
    model: Model,
    normals: Vec<Vec3>,
    old_of_new: Vec<u32>,
}

/// A model with what was learned while its tree grew.
#[derive(Debug)]
pub(super) struct GrownModel {
    pub(super) model: Model,
    pub(super) evidence: ClosedEvidence,
    /// Index in the mesh of each vertex, where that was asked for; else empty.
    pub(super) old_of_new: Vec<u32>,
}

/// Triangles in tree order, vertices in the order of their first use; frees the mesh.
fn arrange(mut mesh: Mesh, leaves: &[Leaf], options: &BuildOptions) -> Result<ArrangedMesh, Error> {
    if let Some(degrees) = options.crease_degrees {
        creases::split(&mut mesh, degrees);
    }
    normals::complete(&mut mesh, NormalWeighting::Area);
    let textured = (mesh.textures.take()).filter(|_| !mesh.triangles.is_empty());
    let points = match &textured {
        Some(textures) => textures::split(&mut mesh, textures, LIMIT),
        None => Vec::new(),
    };
    let items: &[SortItem] = bytemuck::cast_slice(leaves);
    let (triangles, old_of_new, used) = if mesh.triangles.is_empty() {
        if items.is_empty() {
            (Vec::new(), (0..mesh.positions.len() as u32).collect(), 0)
        } else {
            (
                Vec::new(),
                items.iter().map(|item| item.index).collect::<Vec<u32>>(),
                items.len() as u32,
            )
        }
    } else {
        let mut triangles: Vec<[u32; 3]> = items
            .par_iter()
            .with_min_len(4096)
            .map(|item| mesh.triangles[item.index as usize])
            .collect();
        mesh.triangles = Vec::new();
        let (old_of_new, used) = order::by_first_use(&mut triangles, mesh.positions.len());
        (triangles, old_of_new, used)
    };
    let (mut vertices, normals) = order::vertices(&mesh, &old_of_new);
    let has_colors = !mesh.colors.is_empty() || textured.is_some();
    let textures = textured.map(|own| {
        let points: Vec<_> = old_of_new.iter().map(|&old| points[old as usize]).collect();
        let leaf_colors = textures::leaf_means(&own, items);
        textures::color_vertices(&mut vertices, &triangles, (&points, &leaf_colors));
        Arc::new(ModelTextures {
            images: own.images,
            points,
            leaf_colors,
        })
    });
    let origin = mesh.origin;
    drop(mesh);
    let used_vertices = &vertices[..used as usize];
    if let Some(index) = used_vertices
        .par_iter()
        .position_first(|v| !v.position.is_finite())
    {
        let vertex = old_of_new[index] as usize;
        return Err(Error::NotFinite { vertex });
    }
    let extent = VertexExtent::of(used_vertices);
    let mut model = Model {
        used_vertices: used,
        triangles,
        tree: Tree::default(),
        origin,
        min: extent.min,
        max: extent.max,
        orbit_center: extent.center,
        orbit_radius: extent.radius,
        framed: None,
        is_closed: false,
        has_colors,
        vertices,
        textures,
        patches: None,
    };
    model.frame_within(framed::FAR);
    Ok(ArrangedMesh {
        model,
        normals,
        old_of_new,
    })
}
