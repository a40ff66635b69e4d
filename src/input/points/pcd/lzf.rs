//! LZF, the packing of `binary_compressed`.

/// Unpacks LZF (M. Lehmann's LibLZF): runs of up to 32 bytes as they are, and copies of up to 264 bytes from up to 8192
/// before. `None` where it does not give exactly `length` bytes.
pub(super) fn unpack_lzf(packed: &[u8], length: usize) -> Option<Vec<u8>> {
    let mut out: Vec<u8> = Vec::with_capacity(length);
    let mut rest = packed;
    while let Some((&control, after)) = rest.split_first() {
        rest = after;
        if control < 32 {
            let (run, after) = rest.split_at_checked(usize::from(control) + 1)?;
            out.extend_from_slice(run);
            rest = after;
        } else {
            let mut count = usize::from(control >> 5);
            if count == 7 {
                let (&more, after) = rest.split_first()?;
                count += usize::from(more);
                rest = after;
            }
            let (&low, after) = rest.split_first()?;
            rest = after;
            let back = (usize::from(control & 31) << 8) + usize::from(low) + 1;
            let start = out.len().checked_sub(back)?;
            // A copy may reach into what it writes.
            for at in start..start + count + 2 {
                out.push(out[at]);
            }
        }
        if out.len() > length {
            return None;
        }
    }
    (out.len() == length).then_some(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lzf_copies_and_refuses_what_is_damaged() {
        // "abc", then 7 bytes from 3 before.
        let packed = [2, b'a', b'b', b'c', 5 << 5, 2];
        assert_eq!(unpack_lzf(&packed, 10).as_deref(), Some(&b"abcabcabca"[..]));
        assert_eq!(unpack_lzf(&packed, 9), None);
        assert_eq!(unpack_lzf(&packed, 11), None);
        // A long copy of one byte.
        let packed = [0, b'x', 7 << 5, 255, 0];
        assert_eq!(unpack_lzf(&packed, 265), Some(vec![b'x'; 265]));
        for damaged in [&packed[..1], &packed[..3], &packed[..4], &[1 << 5, 0]] {
            assert_eq!(unpack_lzf(damaged, 265), None);
        }
    }
}
