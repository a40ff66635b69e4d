//! glTF 2.0 and its single file GLB (Khronos, "glTF 2.0 Specification", 2021): every mesh of the scene, moved by its nodes,
//! as one mesh; points where there are no triangles.
//!
//! Read are triangles with their strips and fans, points, normals, colors of vertices, the base color of materials and its
//! texture (with KHR_texture_transform), sparse, normalised, interleaved and quantised (KHR_mesh_quantization) accessors. Colors are linear in glTF and become sRGB, as
//! those of all other formats are. Other textures, skins and animations are named and left out; packed geometry is refused with the
//! command that unpacks it.

mod accessor;
mod container;
mod document;
mod scene;
mod texture;

use glam::{DMat3, DMat4, DVec3, Vec3};

use self::accessor::GltfStore;
use self::document::{GltfDocument, GltfPrimitive};
use self::scene::{MeshPlace, places};
use self::texture::SceneTextures;
use super::assemble::{FileCoordinates, RawMesh};
use super::color::encoded_byte;
use super::job::ReadJob;
use super::part::PartFate;
use super::polygon::PolygonRuns;
use super::text::shown;
use super::{Error, FileCounts, FilePlace, Format, ReadWarning};

/// Extensions that change nothing of what is drawn here, or are read.
const KNOWN: [&str; 3] = [
    "KHR_mesh_quantization",
    "KHR_texture_transform",
    "KHR_lights_punctual",
];

/// Memory that instances of meshes may take whatever the size of the file, bytes, and for a byte of it.
const FREE_BYTES: u64 = 24 << 20;
const LARGEST_RATIO: u64 = 256;

/// What has been read so far.
#[derive(Default)]
struct GltfSink {
    positions: Vec<DVec3>,
    /// As many as positions, or none so far.
    normals: Vec<Vec3>,
    absent_normals: u64,
    colors: Vec<[u8; 4]>,
    triangles: Vec<[u32; 3]>,
    points: u64,
    faces: u64,
    lines: u64,
    /// Points of primitives of a file that has triangles.
    loose_points: u64,
    textures: SceneTextures,
}

/// How corners make triangles.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum CornerTopology {
    Points,
    Lines,
    Triangles,
    Strip,
    Fan,
}

impl CornerTopology {
    fn of(mode: Option<u32>) -> Option<Self> {
        match mode.unwrap_or(4) {
            0 => Some(Self::Points),
            1..=3 => Some(Self::Lines),
            4 => Some(Self::Triangles),
            5 => Some(Self::Strip),
            6 => Some(Self::Fan),
            _ => None,
        }
    }
}

/// Reads a glTF or GLB file.
pub(super) fn read(job: &mut ReadJob<'_>, data: &[u8]) -> Result<(Format, RawMesh), Error> {
    let chunks = container::chunks(job, data)?;
    let document: GltfDocument = serde_json::from_slice(chunks.json).map_err(|error| {
        let reason = shown_reason(&error.to_string());
        job.syntax(
            FilePlace::Line(error.line().max(1) as u64),
            format!("the description is no glTF: {reason}"),
        )
    })?;
    if !document.asset.version.starts_with("2.") {
        let version = shown(document.asset.version.as_bytes());
        let reason = format!("glTF version `{version}`; version 2 is read");
        return Err(job.syntax(FilePlace::Byte(0), reason));
    }
    refuse_packed(job, &document)?;
    let store = GltfStore {
        buffers: container::buffers(job, &document, chunks.binary)?,
        document: &document,
        file_bytes: data.len() as u64,
    };
    let places = places(job, &document)?;
    let primitives = |place: &MeshPlace| {
        document
            .meshes
            .get(place.mesh)
            .map_or(&[][..], |mesh| &mesh.primitives)
    };
    let has_triangles = places.iter().flat_map(primitives).any(|primitive| {
        let topology = CornerTopology::of(primitive.mode);
        matches!(
            topology,
            Some(CornerTopology::Triangles | CornerTopology::Strip | CornerTopology::Fan)
        )
    });
    let mut sink = GltfSink::default();
    for place in &places {
        for primitive in primitives(place) {
            add_primitive(job, &store, place, primitive, has_triangles, &mut sink)?;
            if job.progress.is_cancelled() {
                return Err(Error::Cancelled);
            }
        }
    }
    job.report(data.len())?;
    list(job, &document, &places, &sink);
    let format = if chunks.binary.is_some() || data.starts_with(b"glTF") {
        Format::Glb
    } else {
        Format::Gltf
    };
    let white = [255; 4];
    if sink.colors.iter().all(|&color| color == white) {
        sink.colors.clear();
    }
    Ok((
        format,
        RawMesh {
            counts: FileCounts {
                vertices: sink.positions.len() as u64,
                faces: sink.faces,
            },
            coordinates: FileCoordinates::Double(sink.positions),
            normals: sink.normals,
            absent_normals: sink.absent_normals,
            colors: sink.colors,
            triangles: sink.triangles,
            polygons: PolygonRuns::default(),
            textures: sink.textures.finish(),
        },
    ))
}

/// At most 160 characters of what another library says.
fn shown_reason(text: &str) -> String {
    let printable = text.chars().filter(|c| !c.is_control());
    printable.take(160).collect()
}

/// Refuses what must be understood to read the geometry, with the command that takes it away.
fn refuse_packed(job: &ReadJob<'_>, document: &GltfDocument) -> Result<(), Error> {
    for name in &document.extensions_required {
        let (what, command) = match name.as_str() {
            "KHR_draco_mesh_compression" => {
                ("its geometry is packed by Draco", "gltf-transform copy")
            }
            "EXT_meshopt_compression" | "KHR_meshopt_compression" => (
                "its buffers are packed by meshoptimizer",
                "gltf-transform copy",
            ),
            "EXT_mesh_gpu_instancing" => (
                "its meshes are repeated by instancing",
                "gltf-transform copy",
            ),
            known if KNOWN.contains(&known) => continue,
            // Of how surfaces and pictures look.
            looks
                if looks.contains("materials")
                    || looks.contains("texture")
                    || looks.contains("image") =>
            {
                continue;
            }
            other => {
                let name = shown(other.as_bytes());
                return Err(job.syntax(
                    FilePlace::Byte(0),
                    format!("the file requires the extension `{name}`, which is not read"),
                ));
            }
        };
        return Err(Error::NeedsConversion {
            path: job.path.to_owned(),
            what,
            command,
        });
    }
    Ok(())
}

/// Adds a primitive at its place.
fn add_primitive(
    job: &mut ReadJob<'_>,
    store: &GltfStore<'_>,
    place: &MeshPlace,
    primitive: &GltfPrimitive,
    has_triangles: bool,
    sink: &mut GltfSink,
) -> Result<(), Error> {
    let Some(topology) = CornerTopology::of(primitive.mode) else {
        let reason = format!(
            "mesh {}: mode {:?} is not known",
            place.mesh, primitive.mode
        );
        return Err(job.syntax(FilePlace::Byte(0), reason));
    };
    let Some(position) = primitive.attributes.position else {
        return Ok(());
    };
    let positions = store.vectors::<3>(job, position, 0.0)?;
    let count = positions.len();
    match topology {
        CornerTopology::Lines => {
            sink.lines += 1;
            return Ok(());
        }
        CornerTopology::Points if has_triangles => {
            sink.loose_points += count as u64;
            return Ok(());
        }
        _ => {}
    }
    let before = sink.positions.len();
    let wanted = (before + count) as u64;
    let limit = store
        .file_bytes
        .saturating_mul(LARGEST_RATIO)
        .max(FREE_BYTES);
    if wanted.saturating_mul(36) > limit {
        return Err(job.too_large("bytes of all vertices", wanted.saturating_mul(36), limit));
    }
    job.check_vertices(wanted)?;
    let corners = match primitive.indices {
        Some(_) if topology == CornerTopology::Points => Vec::new(),
        Some(indices) => store.indices(job, indices)?,
        None => (0..count as u32).collect(),
    };
    if let Some(&corner) = corners.iter().find(|&&corner| corner as usize >= count) {
        return Err(job.index(FilePlace::Byte(0), "vertex", corner.into(), count as u64, 0));
    }
    let to_world = place.to_world;
    let move_point =
        |point: &[f32; 3]| to_world.transform_point3(Vec3::from_array(*point).as_dvec3());
    sink.positions.extend(positions.iter().map(move_point));
    add_normals(job, store, primitive, &to_world, count, sink)?;
    add_colors(job, store, primitive, count, sink)?;
    if topology == CornerTopology::Points {
        sink.points += count as u64;
    } else {
        let is_mirrored = DMat3::from_mat4(to_world).determinant() < 0.0;
        let first = sink.triangles.len();
        push_triangles(
            topology,
            &corners,
            before as u32,
            is_mirrored,
            &mut sink.triangles,
        );
        sink.faces += (sink.triangles.len() - first) as u64;
        let own = (&sink.triangles[first..], first, before as u32);
        sink.textures.add(job, store, primitive, count, own)?;
        let bytes = (sink.triangles.len() as u64).saturating_mul(12);
        if bytes > limit {
            return Err(job.too_large("bytes of all triangles", bytes, limit));
        }
    }
    Ok(())
}

/// Triangles of a list, a strip (every other one turned) or a fan.
fn push_triangles(
    topology: CornerTopology,
    corners: &[u32],
    first: u32,
    is_mirrored: bool,
    triangles: &mut Vec<[u32; 3]>,
) {
    let mut push = |[a, b, c]: [u32; 3]| {
        let [a, b, c] = [a, b, c].map(|corner| corner + first);
        triangles.push(if is_mirrored { [a, c, b] } else { [a, b, c] });
    };
    match topology {
        CornerTopology::Triangles => {
            let (rows, _) = corners.as_chunks::<3>();
            rows.iter().for_each(|&triangle| push(triangle));
        }
        CornerTopology::Strip => {
            for (at, window) in corners.windows(3).enumerate() {
                let [a, b, c] = [window[0], window[1], window[2]];
                push(if at % 2 == 0 { [a, b, c] } else { [b, a, c] });
            }
        }
        CornerTopology::Fan => {
            let Some((&hub, rim)) = corners.split_first() else {
                return;
            };
            rim.windows(2)
                .for_each(|pair| push([hub, pair[0], pair[1]]));
        }
        CornerTopology::Points | CornerTopology::Lines => {}
    }
}

/// Adds normals where the primitive has them, zeros where only others do.
fn add_normals(
    job: &ReadJob<'_>,
    store: &GltfStore<'_>,
    primitive: &GltfPrimitive,
    to_world: &DMat4,
    count: usize,
    sink: &mut GltfSink,
) -> Result<(), Error> {
    let before = sink.positions.len() - count;
    let Some(normal) = primitive.attributes.normal else {
        if !sink.normals.is_empty() {
            sink.normals.resize(before + count, Vec3::ZERO);
            sink.absent_normals += count as u64;
        }
        return Ok(());
    };
    let normals = store.vectors::<3>(job, normal, 0.0)?;
    if normals.len() != count {
        return Err(different_lengths(job, "normals", normals.len(), count));
    }
    if sink.normals.len() < before {
        sink.absent_normals += (before - sink.normals.len()) as u64;
        sink.normals.resize(before, Vec3::ZERO);
    }
    // The inverse transpose up to its length, which is of no matter; it needs no division, so flat scales do no harm.
    let columns = DMat3::from_mat4(*to_world);
    let (x, y, z) = (columns.x_axis, columns.y_axis, columns.z_axis);
    let sign = if columns.determinant() < 0.0 {
        -1.0
    } else {
        1.0
    };
    let cofactors = DMat3::from_cols(y.cross(z), z.cross(x), x.cross(y)) * sign;
    sink.normals.extend(normals.iter().map(|normal| {
        let turned = cofactors * Vec3::from_array(*normal).as_dvec3();
        turned.try_normalize().unwrap_or(DVec3::ZERO).as_vec3()
    }));
    Ok(())
}

fn different_lengths(job: &ReadJob<'_>, what: &str, found: usize, wanted: usize) -> Error {
    let reason = format!("a primitive has {found} {what} for {wanted} positions");
    job.syntax(FilePlace::Byte(0), reason)
}

/// Adds colors: those of the vertices times the base color of the material.
fn add_colors(
    job: &ReadJob<'_>,
    store: &GltfStore<'_>,
    primitive: &GltfPrimitive,
    count: usize,
    sink: &mut GltfSink,
) -> Result<(), Error> {
    let material = primitive
        .material
        .and_then(|index| store.document.materials.get(index));
    let factor = material.map_or([1.0; 3], texture::base_color);
    let color = |of: [f64; 3]| {
        let [red, green, blue] =
            [0, 1, 2].map(|channel: usize| encoded_byte(of[channel] * factor[channel]));
        [red, green, blue, 255]
    };
    match primitive.attributes.color {
        None => {
            let color = color([1.0; 3]);
            sink.colors.extend(std::iter::repeat_n(color, count));
        }
        Some(accessor) => {
            let colors = store.vectors::<4>(job, accessor, 1.0)?;
            if colors.len() != count {
                return Err(different_lengths(job, "colors", colors.len(), count));
            }
            let of = |&[red, green, blue, _]: &[f32; 4]| color([red, green, blue].map(f64::from));
            sink.colors.extend(colors.iter().map(of));
        }
    }
    Ok(())
}

/// Says what the file holds and what was left out.
fn list(job: &mut ReadJob<'_>, document: &GltfDocument, places: &[MeshPlace], sink: &GltfSink) {
    for (index, mesh) in document.meshes.iter().enumerate() {
        let times = places.iter().filter(|place| place.mesh == index).count() as u64;
        let name = format!("mesh {}", shown(mesh.name.as_bytes()));
        let fate = if times == 0 {
            PartFate::Unneeded
        } else {
            PartFate::Used
        };
        let note = if times == 0 {
            "not in the scene"
        } else {
            "times drawn"
        };
        job.inventory.add(name, times, fate, note);
    }
    let others: Vec<&str> = document
        .meshes
        .iter()
        .flat_map(|mesh| &mesh.primitives)
        .flat_map(|primitive| primitive.attributes.others.keys())
        .map(String::as_str)
        .collect();
    let mut names = others.clone();
    names.sort_unstable();
    names.dedup();
    for name in names {
        let count = others.iter().filter(|other| **other == name).count() as u64;
        let fate = match sink.textures.reads(name) {
            true => PartFate::Used,
            false => PartFate::Unneeded,
        };
        let shown = format!("attribute {}", shown(name.as_bytes()));
        job.inventory.add(shown, count, fate, "");
    }
    for material in &document.materials {
        let name = format!("material {}", shown(material.name.as_bytes()));
        let has_texture = texture::of_material(material).is_some();
        let note = match (has_texture, job.options.textures) {
            (false, _) => "base color",
            (true, true) => "base color and its texture",
            (true, false) => "base color; its texture was not asked for",
        };
        job.inventory.add(name, 1, PartFate::Used, note);
    }
    let see_through = document
        .materials
        .iter()
        .filter(|material| !matches!(material.alpha_mode.as_str(), "" | "OPAQUE"));
    let see_through = see_through.count();
    if see_through > 0 {
        job.inventory
            .leave_out(format!("transparency of {see_through} materials"));
    }
    let faulty = sink.textures.faulty;
    if faulty > 0 {
        job.inventory.leave_out(format!(
            "texture coordinates of {faulty} primitives, which are damaged"
        ));
    }
    if sink.textures.leaves_colors {
        job.inventory.leave_out("colors of vertices under textures");
    }
    for (index, image) in document.images.iter().enumerate() {
        if !sink.textures.has_image(index) {
            let name = format!("image {}", shown(image.shown_name(index).as_bytes()));
            let why = "no base color of a surface with texture coordinates";
            job.inventory.add(name, 1, PartFate::Unneeded, why);
        }
    }
    let is_ktx = |image: &&document::GltfImage| {
        image.mime_type == "image/ktx2"
            || image
                .uri
                .as_deref()
                .is_some_and(|uri| uri.ends_with(".ktx2"))
    };
    let packed = document.images.iter().filter(is_ktx).count();
    if packed > 0 {
        job.inventory.leave_out(format!(
            "{packed} KTX2 textures (`gltf-transform ktxdecompress IN.glb OUT.glb` unpacks them)"
        ));
    }
    for (what, count) in [
        ("animations", document.animations.len()),
        ("skins", document.skins.len()),
        ("cameras", document.cameras.len()),
        ("textures", document.textures.len()),
    ] {
        job.inventory
            .add_some(what, count as u64, PartFate::Unneeded, "");
    }
    let morphed = document.meshes.iter().flat_map(|mesh| &mesh.primitives);
    let morphed = morphed
        .filter(|primitive| !primitive.targets.is_empty())
        .count();
    if morphed > 0 {
        job.inventory
            .leave_out(format!("morph targets of {morphed} primitives"));
    }
    if places.iter().any(|place| place.is_skinned) {
        job.inventory.leave_out("the pose of skinned meshes");
    }
    job.warn_count(sink.lines, |count| ReadWarning::PartsIgnored {
        what: "primitives of lines",
        count,
    });
    job.warn_count(sink.loose_points, |count| ReadWarning::PartsIgnored {
        what: "points beside triangles",
        count,
    });
    job.inventory
        .add_some("points", sink.points, PartFate::Used, "");
    job.inventory
        .add_some("triangles", sink.faces, PartFate::Used, "");
}
