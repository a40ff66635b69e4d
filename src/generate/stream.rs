//! Generated models piece by piece, never held as a whole.

use super::{ShapeSpec, ShapeSurface, surface};
use crate::mesh::stream::{MeshStream, PIECE, StreamError, StreamFacts, TakePiece, VertexPiece};
use glam::Vec3;
use rayon::prelude::*;
use std::ops::Range;

/// A generated surface that is made anew each time it is read.
pub struct GeneratedStream {
    spec: ShapeSpec,
    surface: Box<dyn ShapeSurface>,
    /// Blocks of vertices.
    blocks: Vec<Range<usize>>,
}

impl std::fmt::Debug for GeneratedStream {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("GeneratedStream").field(&self.spec).finish()
    }
}

impl GeneratedStream {
    /// The stream of a specification.
    pub fn new(spec: ShapeSpec) -> Self {
        let surface = surface(&spec);
        Self {
            blocks: surface.vertex_blocks(),
            spec,
            surface,
        }
    }

    fn block(&self, block: &Range<usize>) -> GeneratedBlock {
        let mut made = GeneratedBlock {
            positions: vec![Vec3::ZERO; block.len()],
            normals: vec![Vec3::ZERO; block.len()],
        };
        self.surface
            .vertices(block.clone(), &mut made.positions, &mut made.normals);
        made
    }
}

/// Vertices of a block.
struct GeneratedBlock {
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
}

/// The pieces of vertices of some blocks, in order.
fn joined(pieces: Vec<VertexPiece>) -> VertexPiece {
    let mut all = VertexPiece::default();
    for piece in pieces {
        all.positions.extend(piece.positions);
        all.normals.extend(piece.normals);
    }
    all
}

impl MeshStream for GeneratedStream {
    fn facts(&self) -> StreamFacts {
        let (vertices, faces) = self.spec.counts();
        StreamFacts {
            vertices,
            faces,
            has_normals: true,
            has_colors: false,
        }
    }

    fn vertices(&self, take: &mut TakePiece<'_, VertexPiece>) -> Result<(), StreamError> {
        self.blocks.chunks(8).try_for_each(|blocks| {
            let of_block = |block: &Range<usize>| {
                let made = self.block(block);
                VertexPiece {
                    positions: made.positions.iter().map(|p| p.as_dvec3()).collect(),
                    normals: made.normals,
                    colors: Vec::new(),
                }
            };
            take(&joined(blocks.par_iter().map(of_block).collect()))
        })
    }

    fn vertices_at(&self, numbers: &[u32]) -> Result<VertexPiece, StreamError> {
        if let Some(&last) = numbers.last()
            && u64::from(last) >= self.facts().vertices
        {
            return Err(format!("vertex {last} of {}", self.facts().vertices).into());
        }
        let first_of = |block: &Range<usize>| {
            numbers.partition_point(|&number| (number as usize) < block.start)
        };
        let of_block = |block: &Range<usize>| {
            let own = first_of(block)..numbers.partition_point(|&n| (n as usize) < block.end);
            if own.is_empty() {
                return VertexPiece::default();
            }
            let made = self.block(block);
            let places = || {
                numbers[own.clone()]
                    .iter()
                    .map(|&n| n as usize - block.start)
            };
            VertexPiece {
                positions: places().map(|i| made.positions[i].as_dvec3()).collect(),
                normals: places().map(|i| made.normals[i]).collect(),
                colors: Vec::new(),
            }
        };
        Ok(joined(self.blocks.par_iter().map(of_block).collect()))
    }

    fn triangles(&self, take: &mut TakePiece<'_, [[u32; 3]]>) -> Result<(), StreamError> {
        let blocks = self.surface.triangle_blocks();
        let mut rest = &blocks[..];
        while !rest.is_empty() {
            let mut sum = 0;
            let full = rest.iter().position(|block| {
                sum += block.len();
                sum > PIECE
            });
            let (own, later) = rest.split_at(full.unwrap_or(rest.len()).max(1));
            rest = later;
            let made: Vec<Vec<[u32; 3]>> = (own.par_iter())
                .map(|block| {
                    let mut triangles = vec![[0; 3]; block.len()];
                    self.surface.triangles(block.clone(), &mut triangles);
                    triangles
                })
                .collect();
            take(&made.concat())?;
        }
        Ok(())
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;
    use crate::generate::{GeneratedShape, mesh};

    #[test]
    fn the_pieces_are_the_whole() {
        for shape in [GeneratedShape::Statue, GeneratedShape::Torus] {
            let spec = ShapeSpec::with_triangles(shape, 60_000).unwrap();
            let (whole, stream) = (mesh(&spec), GeneratedStream::new(spec));
            assert_eq!(stream.facts(), whole.facts());
            let mut positions = Vec::new();
            stream
                .vertices(&mut |piece: &VertexPiece| {
                    positions.extend(piece.positions.iter().map(|p| p.as_vec3()));
                    Ok(())
                })
                .unwrap();
            assert_eq!(positions, whole.positions);
            let mut triangles = Vec::new();
            stream
                .triangles(&mut |piece: &[[u32; 3]]| {
                    triangles.extend_from_slice(piece);
                    Ok(())
                })
                .unwrap();
            assert_eq!(triangles, whole.triangles);
            let numbers: Vec<u32> = (5..whole.positions.len() as u32).step_by(7919).collect();
            let picked = stream.vertices_at(&numbers).unwrap();
            assert_eq!(picked, whole.vertices_at(&numbers).unwrap());
        }
    }
}
