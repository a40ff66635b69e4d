//! Simplifications of the whole mesh, each of half the triangles of the one before, by the crate meshopt.
//!
//! Source: Garland and Heckbert, *Surface Simplification Using Quadric Error Metrics* (1997), as meshoptimizer has it. The
//! error of a level is the sum of the errors of the steps that led to it, which bounds the distance from the model.

use super::RivalLevel;
use crate::bench::BenchError;
use crate::mesh::Mesh;
use crate::progress::Progress;
use crate::tree::{self, BuildOptions, Model};
use meshopt::{SimplifyOptions, VertexDataAdapter};

/// A level of fewer triangles is of no use to anybody.
const FEWEST: usize = 500;

/// The chain of a model, the whole mesh first.
pub(super) fn build(model: &Model, progress: &dyn Progress) -> Result<Vec<RivalLevel>, BenchError> {
    let fail = |e: meshopt::Error| BenchError::Rival {
        name: "meshopt",
        cause: e.to_string(),
    };
    let stride = size_of_val(&model.vertices[..1.min(model.vertices.len())]).max(1);
    let offset = std::mem::offset_of!(crate::abi::Vertex, position);
    let bytes: &[u8] = bytemuck::cast_slice(&model.vertices);
    let vertices = VertexDataAdapter::new(bytes, stride, offset).map_err(fail)?;
    let mut chain = vec![RivalLevel {
        triangles: model.triangles.clone(),
        error: 0.0,
    }];
    progress.stage("simplify", u64::from(model.triangles.len().max(1).ilog2()));
    let mut last = 0.0;
    while let Some(level) = chain.last() {
        if progress.is_cancelled() {
            return Err(BenchError::Cancelled);
        }
        let corners: &[u32] = bytemuck::cast_slice(&level.triangles);
        let count = level.triangles.len();
        if count / 2 < FEWEST {
            break;
        }
        let mut error = 0.0;
        let fewer = meshopt::simplify(
            corners,
            &vertices,
            count / 2 * 3,
            f32::MAX,
            SimplifyOptions::ErrorAbsolute,
            Some(&mut error),
        );
        // What cannot be simplified any more ends the chain.
        if fewer.len() / 3 > count / 10 * 9 || fewer.len() < 3 {
            break;
        }
        last += error;
        let triangles = fewer.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect();
        chain.push(RivalLevel {
            triangles,
            error: last,
        });
        progress.advance(1);
    }
    Ok(chain)
}

/// A level as a model of its own, with the vertices that it uses.
pub(super) fn model(of: &Model, level: &RivalLevel) -> Result<Model, BenchError> {
    let mut new = vec![u32::MAX; of.vertices.len()];
    let mut mesh = Mesh {
        origin: of.origin,
        ..Mesh::default()
    };
    for triangle in &level.triangles {
        let corners = triangle.map(|i| {
            let at = &mut new[i as usize];
            if *at == u32::MAX {
                *at = mesh.positions.len() as u32;
                let vertex = &of.vertices[i as usize];
                mesh.positions.push(vertex.position);
                mesh.normals
                    .push(crate::math::octahedral::decode(vertex.normal));
                if of.has_colors {
                    mesh.colors.push(vertex.color);
                }
            }
            *at
        });
        mesh.triangles.push(corners);
    }
    Ok(tree::build(
        mesh,
        &BuildOptions::default(),
        &crate::progress::SilentProgress,
    )?)
}
