//! What readers of tables of points have read so far, and the end of every one of them.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::super::assemble::{FileCoordinates, RawMesh};
use super::super::color::{ColorRange, ColorSink};
use super::super::job::ReadJob;
use super::super::polygon::PolygonRuns;
use super::super::{Error, FileCounts, ReadWarning};
use super::keep_attributes;
use crate::mesh::attributes::{AttributeColumn, AttributeValues, NumberType};
use crate::mesh::scanners::ScannerPlaces;

/// Points of a part of a table.
#[derive(Debug, Default)]
pub(super) struct TableBlock {
    pub(super) positions: Vec<DVec3>,
    pub(super) normals: Vec<Vec3>,
    pub(super) colors: Vec<[f32; 3]>,
    /// One list a column, each as long as `positions`.
    pub(super) values: Vec<AttributeValues>,
}

/// Points of a table so far. Normals and colors are as many as positions, or none.
#[derive(Debug)]
pub(super) struct CloudSink {
    pub(super) positions: Vec<DVec3>,
    pub(super) normals: Vec<Vec3>,
    pub(super) colors: ColorSink,
    pub(super) columns: Vec<AttributeColumn>,
    /// Scanners of the positions, where the file says where they stood.
    pub(super) scanners: ScannerPlaces,
    /// Points of the file, those left out included.
    pub(super) points: u64,
    /// Scans in the file, and how many of them it moves.
    pub(super) scans: u64,
    pub(super) posed: u64,
    /// Points that stand for no measurement.
    pub(super) holes: u64,
}

impl CloudSink {
    pub(super) fn new(columns: Vec<AttributeColumn>, range: ColorRange) -> Self {
        Self {
            positions: Vec::new(),
            normals: Vec::new(),
            colors: ColorSink::new([range; 3]),
            columns,
            scanners: ScannerPlaces::default(),
            points: 0,
            scans: 0,
            posed: 0,
            holes: 0,
        }
    }

    pub(super) fn append(&mut self, block: TableBlock) {
        self.positions.extend_from_slice(&block.positions);
        self.normals.extend_from_slice(&block.normals);
        for color in block.colors {
            self.colors.push(color.map(f64::from));
        }
        for (column, values) in self.columns.iter_mut().zip(block.values) {
            column.values.append(values);
        }
    }

    /// Says what was found, and gives the cloud to the last step.
    pub(super) fn finish(mut self, job: &mut ReadJob<'_>) -> Result<RawMesh, Error> {
        job.check_vertices(self.positions.len() as u64)?;
        if self.positions.is_empty() {
            return Err(job.empty("the file has no points"));
        }
        let holes = self.holes;
        job.warn_count(holes, |count| ReadWarning::PointsDropped {
            what: "points without a measurement",
            count,
        });
        if self.scans > 1 {
            job.warn(ReadWarning::ScansJoined {
                count: self.scans,
                posed: self.posed,
            });
        }
        job.warnings.extend(self.colors.remark());
        for column in &mut self.columns {
            narrow(column);
        }
        keep_attributes(job, self.columns);
        job.scanners = self.scanners;
        let faces = 0;
        Ok(RawMesh {
            coordinates: settled(self.positions),
            normals: self.normals,
            absent_normals: 0,
            colors: self.colors.colors,
            triangles: Vec::new(),
            polygons: PolygonRuns::default(),
            counts: FileCounts {
                vertices: self.points,
                faces,
            },
            textures: None,
        })
    }
}

/// Positions in single precision where that loses nothing: half the memory in the last step.
fn settled(positions: Vec<DVec3>) -> FileCoordinates {
    let is_single = |point: &DVec3| point.as_vec3().as_dvec3() == *point || !point.is_finite();
    if positions.par_iter().with_min_len(1 << 16).all(is_single) {
        let single = positions.par_iter().map(|point| point.as_vec3()).collect();
        FileCoordinates::Single(single)
    } else {
        FileCoordinates::Double(positions)
    }
}

/// Doubles as the smallest type that holds them: bytes and words for whole numbers, single precision for quantities other
/// than times.
fn narrow(column: &mut AttributeColumn) {
    let AttributeValues::F64(values) = &column.values else {
        return;
    };
    let whole = |low: f64, high: f64| {
        let fits = |value: &f64| value.fract() == 0.0 && (low..=high).contains(value);
        values.par_iter().with_min_len(1 << 16).all(fits)
    };
    let number = if whole(0.0, 255.0) {
        NumberType::U8
    } else if whole(0.0, 65535.0) {
        NumberType::U16
    } else if whole(-32768.0, 32767.0) {
        NumberType::I16
    } else if whole(-2_147_483_648.0, 2_147_483_647.0) {
        NumberType::I32
    } else if column.name.contains("time") {
        return;
    } else {
        NumberType::F32
    };
    column.values = column.values.converted(number);
}
