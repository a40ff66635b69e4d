//! Numbers of vertices beside position, normal, color and texture coordinate: attributes, as those of point clouds.

use super::super::job::ReadJob;
use super::super::points::{attribute_name, keep_attributes, kind_of};
use super::columns::KeptColumn;
use super::header::{PlyElement, ScalarType};
use crate::mesh::attributes::{AttributeColumn, AttributeValues, NumberType};

/// Type in which values are kept.
pub(super) fn number_of(kind: ScalarType) -> NumberType {
    match kind {
        ScalarType::U8 => NumberType::U8,
        ScalarType::I8 => NumberType::I8,
        ScalarType::U16 => NumberType::U16,
        ScalarType::I16 => NumberType::I16,
        ScalarType::U32 => NumberType::U32,
        ScalarType::I32 => NumberType::I32,
        ScalarType::F32 => NumberType::F32,
        ScalarType::I64 | ScalarType::U64 | ScalarType::F64 => NumberType::F64,
    }
}

/// Attribute of a property with these values.
pub(super) fn column(
    element: &PlyElement,
    column: KeptColumn,
    values: AttributeValues,
) -> AttributeColumn {
    // A program that has many scalar fields marks them so.
    let written = element.names[column.property].to_lowercase();
    let name = attribute_name(written.strip_prefix("scalar_").unwrap_or(&written));
    let count = values.len();
    let bits = |at: usize| values.get(at).map(f64::to_bits);
    let values = match values.get(0) {
        Some(value) if (1..count).all(|at| bits(at) == Some(value.to_bits())) => {
            AttributeValues::Constant {
                number: values.number(),
                value,
                count,
            }
        }
        _ => values,
    };
    AttributeColumn {
        kind: kind_of(&name),
        name,
        scale: 1.0,
        offset: 0.0,
        values,
    }
}

/// Keeps attributes of a file whose mesh has this many vertices; those of fewer are left out: vertices were divided by colors of faces.
pub(super) fn keep(job: &mut ReadJob<'_>, columns: Vec<AttributeColumn>, vertices: usize) {
    let is_whole = |column: &AttributeColumn| column.values.len() == vertices;
    let (whole, others): (Vec<_>, Vec<_>) = columns.into_iter().partition(is_whole);
    for column in others {
        (job.inventory).leave_out(format!("{} of vertices, which faces color", column.name));
    }
    keep_attributes(job, whole);
}
