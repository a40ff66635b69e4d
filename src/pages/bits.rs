//! Numbers of a few bits each, one after the other, least significant bit first.

/// Bytes of `count` numbers of `bits` bits.
pub(super) fn packed_bytes(count: usize, bits: u32) -> usize {
    (count * bits as usize).div_ceil(8)
}

/// Bits that numbers below `end` need; 0 where there is only one.
pub(super) fn bits_below(end: usize) -> u32 {
    end.saturating_sub(1)
        .checked_ilog2()
        .map_or(0, |log| log + 1)
}

/// Appends numbers of `bits` bits, at most 24; the last byte is filled up with zeros.
pub(super) fn pack(values: impl Iterator<Item = u32>, bits: u32, out: &mut Vec<u8>) {
    let (mut held, mut count) = (0u64, 0);
    for value in values {
        held |= u64::from(value) << count;
        count += bits;
        while count >= 8 {
            out.push(held as u8);
            held >>= 8;
            count -= 8;
        }
    }
    if count > 0 {
        out.push(held as u8);
    }
}

/// Number `index` of `bits` bits, at most 24; 0 past the end.
#[inline(always)]
pub(super) fn unpack(bytes: &[u8], bits: u32, index: usize) -> u32 {
    let first = index * bits as usize;
    let word = match bytes
        .get(first / 8..)
        .and_then(|rest| rest.first_chunk::<4>())
    {
        Some(word) => u32::from_le_bytes(*word),
        None => last_word(bytes, first / 8) as u32,
    };
    // 24 bits and 7 to skip fit 32.
    word >> (first % 8) & ((1u32 << bits) - 1)
}

/// Fills triples with numbers of `bits` bits, at most 16, from the first on.
pub(super) fn unpack_triples(bytes: &[u8], bits: u32, triples: &mut [[u32; 3]]) {
    for (index, triple) in triples.iter_mut().enumerate() {
        let first = index * 3 * bits as usize;
        let word = match bytes
            .get(first / 8..)
            .and_then(|rest| rest.first_chunk::<8>())
        {
            Some(word) => u64::from_le_bytes(*word),
            None => last_word(bytes, first / 8),
        };
        // 48 bits and 7 to skip fit 64.
        let word = word >> (first % 8);
        *triple = [0, bits, 2 * bits].map(|skip| (word >> skip) as u32 & ((1 << bits) - 1));
    }
}

#[cold]
fn last_word(bytes: &[u8], at: usize) -> u64 {
    let mut word = [0; 8];
    for (to, from) in word.iter_mut().zip(bytes.get(at..).unwrap_or_default()) {
        *to = *from;
    }
    u64::from_le_bytes(word)
}

/// Tells whether the bits after the last of `count` numbers are zero, as [`pack`] leaves them.
pub(super) fn is_filled_with_zeros(bytes: &[u8], count: usize, bits: u32) -> bool {
    let used = count * bits as usize % 8;
    used == 0 || bytes.last().is_none_or(|last| last >> used == 0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_come_back() {
        for bits in 0..=24u32 {
            for count in [0usize, 1, 2, 3, 7, 8, 100] {
                let values: Vec<u32> = (0..count as u32)
                    .map(|i| i.wrapping_mul(0x9e37_79b9) & ((1 << bits) - 1))
                    .collect();
                let mut bytes = Vec::new();
                pack(values.iter().copied(), bits, &mut bytes);
                assert_eq!(bytes.len(), packed_bytes(count, bits));
                assert!(is_filled_with_zeros(&bytes, count, bits));
                for (index, value) in values.iter().enumerate() {
                    assert_eq!(unpack(&bytes, bits, index), *value, "{bits} {index}");
                }
                let mut triples = vec![[0; 3]; if bits <= 16 { count / 3 } else { 0 }];
                unpack_triples(&bytes, bits, &mut triples);
                assert!(values.starts_with(triples.as_flattened()), "{bits} {count}");
            }
        }
        assert_eq!(
            [0, 1, 2, 3, 4, 5, 256, 257].map(bits_below),
            [0, 0, 1, 2, 2, 3, 8, 9]
        );
        assert!(!is_filled_with_zeros(&[0x80], 1, 7));
        assert_eq!(unpack(&[1], 8, 5), 0);
    }
}
