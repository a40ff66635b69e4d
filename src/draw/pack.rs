//! From a cut to the triangles of a draw list, written straight into the caller's memory.

/// Writes the corners of the cut's triangles with ids in `range`, as `corners` has them.
///
/// # Panics
/// When `out` is shorter than `ids`.
pub fn triangles(ids: &[u32], corners: &[[u32; 3]], first_id: u32, out: &mut [[u32; 3]]) {
    for (out, &id) in out[..ids.len()].iter_mut().zip(ids) {
        *out = corners[(id - first_id) as usize];
    }
}
