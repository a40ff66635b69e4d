//! Clouds as files: what is kept of a scan, with all that its points carry.

use crate::Error;
use crate::generate;
use crate::input::{self, FilePart, FilteredPoints, PointFilter, write_las};
use crate::mesh::Mesh;
use crate::mesh::attributes::{AttributeColumn, NumberType, PointAttributes};
use crate::progress::Progress;
use glam::{DVec3, I64Vec3};
use std::collections::HashSet;
use std::io::{self, BufWriter, Write};
use std::path::Path;

/// A kind of file that clouds are written as.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CloudFormat {
    /// PLY, binary, least significant byte first.
    Ply,
    /// LAS 1.4.
    Las,
    /// LAS 1.4, packed.
    Laz,
}

/// What is written of a cloud.
#[derive(Debug, Clone, Default)]
pub struct ExportOptions {
    /// How the file is read.
    pub input: input::ReadOptions,
    /// What is kept.
    pub keep: PointFilter,
    /// Of points in one cell of this size only the first is kept, units of the coordinates.
    pub spacing: Option<f64>,
}

/// What was written.
#[derive(Debug, Clone, Default)]
pub struct ExportReport {
    /// Points of the file, and those written.
    pub points: [u64; 2],
    /// What was repaired or left out.
    pub warnings: Vec<input::ReadWarning>,
}

/// Reads the cloud of a file (`-` for standard input) and writes what is kept of it, in the order of the file. The file
/// appears when it is complete. No tree is built.
///
/// # Errors
/// As [`input::load`]; a mesh; a field that is not there; nothing kept; the file cannot be written.
pub fn export(
    source: &Path,
    options: &ExportOptions,
    (format, output): (CloudFormat, &Path),
    progress: &dyn Progress,
) -> Result<ExportReport, Error> {
    let loaded = input::load(source, &options.input, progress)?;
    let (mut mesh, mut attributes) = (loaded.mesh, loaded.attributes);
    if !mesh.is_cloud() {
        return Err(input::Error::NoCloud {
            path: source.to_owned(),
        }
        .into());
    }
    let count = mesh.positions.len();
    let place = |index: usize| mesh.positions[index];
    let mut mask = options.keep.mask(&FilteredPoints {
        path: source,
        count,
        place: &place,
        origin: mesh.origin,
        attributes: &attributes,
    })?;
    if let Some(spacing) = options.spacing {
        thin(&mesh, spacing, &mut mask);
    }
    let kept = mask.iter().filter(|&&is_kept| is_kept).count();
    if kept == 0 {
        return Err(input::Error::NothingKept {
            path: source.to_owned(),
            count: count as u64,
            what: "points",
            filter: options.keep.to_string(),
        }
        .into());
    }
    retain(&mut mesh, &mut attributes, &mask);
    progress.stage("write", 0);
    let mut has_system = false;
    generate::write_atomically(output, |file| {
        let mut out = BufWriter::with_capacity(1 << 20, file);
        match format {
            CloudFormat::Ply => write_ply(&mesh, &attributes, &mut out)?,
            CloudFormat::Las | CloudFormat::Laz => {
                let is_packed = format == CloudFormat::Laz;
                let records = &loaded.coordinate_records;
                has_system = write_las((&mesh, &attributes), records, is_packed, &mut out)?;
            }
        }
        Ok(out.flush()?)
    })?;
    let mut warnings = loaded.warnings;
    let is_system = |part: &FilePart| part.name == "coordinate system";
    if !has_system && loaded.parts.iter().any(is_system) {
        let parts = vec!["the coordinate system of the file, which is not written".to_owned()];
        warnings.push(input::ReadWarning::LeftOut { parts });
    }
    Ok(ExportReport {
        points: [count as u64, kept as u64],
        warnings,
    })
}

/// The kind of file that an ending means.
pub fn format_of(path: &Path) -> Option<CloudFormat> {
    let ending = path.extension()?.to_str()?.to_ascii_lowercase();
    match ending.as_str() {
        "ply" => Some(CloudFormat::Ply),
        "las" => Some(CloudFormat::Las),
        "laz" => Some(CloudFormat::Laz),
        _ => None,
    }
}

/// Keeps the first point of each cell.
fn thin(mesh: &Mesh, spacing: f64, mask: &mut [bool]) {
    let mut taken: HashSet<I64Vec3> = HashSet::new();
    for (is_kept, place) in mask.iter_mut().zip(&mesh.positions) {
        if *is_kept {
            // In world space, so that tiles of one survey have the same cells. The cast saturates.
            let cell = ((mesh.origin + place.as_dvec3()) / spacing).floor();
            *is_kept = taken.insert(cell.as_i64vec3());
        }
    }
}

/// Leaves out what is not kept.
fn retain(mesh: &mut Mesh, attributes: &mut PointAttributes, mask: &[bool]) {
    fn of<T>(items: &mut Vec<T>, mask: &[bool]) {
        let mut kept = mask.iter();
        items.retain(|_| kept.next() == Some(&true));
    }
    of(&mut mesh.positions, mask);
    of(&mut mesh.normals, mask);
    of(&mut mesh.colors, mask);
    for column in &mut attributes.columns {
        column.values.retain(|index| mask.get(index) == Some(&true));
    }
}

/// Type of a column in PLY: that of its values, or double where these have a scale.
fn ply_type(column: &AttributeColumn) -> NumberType {
    if (column.scale, column.offset) == (1.0, 0.0) {
        column.values.number()
    } else {
        NumberType::F64
    }
}

fn write_ply(mesh: &Mesh, attributes: &PointAttributes, out: &mut impl Write) -> io::Result<()> {
    let is_double = mesh.origin != DVec3::ZERO || attributes.grid.is_some();
    let coordinate = if is_double { "double" } else { "float" };
    let mut head = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\n",
        mesh.positions.len()
    );
    for name in ["x", "y", "z"] {
        head += &format!("property {coordinate} {name}\n");
    }
    if !mesh.normals.is_empty() {
        head += "property float nx\nproperty float ny\nproperty float nz\n";
    }
    if !mesh.colors.is_empty() {
        head += "property uchar red\nproperty uchar green\nproperty uchar blue\n";
    }
    for column in &attributes.columns {
        let number = match ply_type(column) {
            NumberType::U8 => "uchar",
            NumberType::I8 => "char",
            NumberType::U16 => "ushort",
            NumberType::I16 => "short",
            NumberType::U32 => "uint",
            NumberType::I32 => "int",
            NumberType::F32 => "float",
            NumberType::F64 => "double",
        };
        let name: String = (column.name.chars())
            .map(|c| if c.is_ascii_graphic() { c } else { '_' })
            .collect();
        head += &format!("property {number} {name}\n");
    }
    out.write_all((head + "end_header\n").as_bytes())?;
    let mut row = Vec::new();
    for (index, &place) in mesh.positions.iter().enumerate() {
        row.clear();
        if is_double {
            let world = mesh.origin + place.as_dvec3();
            let world = attributes.grid.map_or(world, |grid| grid.nearest(world));
            row.extend(world.to_array().into_iter().flat_map(f64::to_le_bytes));
        } else {
            row.extend(place.to_array().into_iter().flat_map(f32::to_le_bytes));
        }
        if let Some(normal) = mesh.normals.get(index) {
            row.extend(normal.to_array().into_iter().flat_map(f32::to_le_bytes));
        }
        if let Some(color) = mesh.colors.get(index) {
            row.extend(&color[..3]);
        }
        for column in &attributes.columns {
            let value = column.value(index).unwrap_or(0.0);
            match ply_type(column) {
                NumberType::U8 => row.extend((value as u8).to_le_bytes()),
                NumberType::I8 => row.extend((value as i8).to_le_bytes()),
                NumberType::U16 => row.extend((value as u16).to_le_bytes()),
                NumberType::I16 => row.extend((value as i16).to_le_bytes()),
                NumberType::U32 => row.extend((value as u32).to_le_bytes()),
                NumberType::I32 => row.extend((value as i32).to_le_bytes()),
                NumberType::F32 => row.extend((value as f32).to_le_bytes()),
                NumberType::F64 => row.extend(value.to_le_bytes()),
            }
        }
        out.write_all(&row)?;
    }
    Ok(())
}
