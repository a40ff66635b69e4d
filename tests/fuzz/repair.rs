//! Makes checksums right again after damage, so that what stands behind them is reached.

use surfel::tree::file::hash;

/// Repairs what the beginning of the file shows it to have; leaves other files as they are.
pub(crate) fn repair(bytes: &mut [u8]) {
    match bytes.get(..8) {
        Some(b"surfel\x1a\n") => tree(bytes),
        Some(b"surfel\x1aP") => paged(bytes),
        Some(b"\x89PNG\r\n\x1a\n") => png(bytes),
        Some(b"ASTM-E57") => e57(bytes),
        _ => {}
    }
}

fn word(bytes: &[u8], at: usize) -> u64 {
    let mut buffer = [0; 8];
    buffer.copy_from_slice(&bytes[at..at + 8]);
    u64::from_le_bytes(buffer)
}

fn set(bytes: &mut [u8], at: usize, value: u64) {
    bytes[at..at + 8].copy_from_slice(&value.to_le_bytes());
}

/// A tree file: nine sections of offset, count, stride and checksum from byte 96 on, then the header's own.
fn tree(bytes: &mut [u8]) {
    const HEADER: usize = 392;
    if bytes.len() < HEADER {
        return;
    }
    for section in 0..9 {
        let at = 96 + 32 * section;
        let [offset, count, stride] = [0, 8, 16].map(|i| word(bytes, at + i));
        let size = count.saturating_mul(stride);
        let end = offset.saturating_add(size);
        if size <= 1 << 20 && end <= bytes.len() as u64 {
            let inside = &bytes[offset as usize..end as usize];
            let pieces: Vec<u64> = inside.chunks(1 << 20).map(hash).collect();
            let sum = hash(bytemuck::cast_slice(&pieces)) ^ size;
            set(bytes, at + 24, sum);
        }
    }
    let length = bytes.len() as u64;
    set(bytes, 16, length);
    let sum = hash(&bytes[..HEADER - 8]);
    set(bytes, HEADER - 8, sum);
}

/// A paged file: the entry of the first page from byte 112 on, then the header's own checksum.
fn paged(bytes: &mut [u8]) {
    const HEADER: usize = 144;
    if bytes.len() < HEADER {
        return;
    }
    let length = u64::from(u32::from_le_bytes([116, 117, 118, 119].map(|i| bytes[i])));
    let offset = word(bytes, 120);
    let end = offset.saturating_add(length);
    if end <= bytes.len() as u64 {
        let sum = hash(&bytes[offset as usize..end as usize]);
        set(bytes, 128, sum);
    }
    let length = bytes.len() as u64;
    set(bytes, 16, length);
    let sum = hash(&bytes[..HEADER - 8]);
    set(bytes, HEADER - 8, sum);
}

/// PNG: the CRC after each chunk.
fn png(bytes: &mut [u8]) {
    let mut at = 8;
    while at + 12 <= bytes.len() {
        let length = u32::from_be_bytes([0, 1, 2, 3].map(|i| bytes[at + i])) as usize;
        let end = at + 8 + length;
        if end + 4 > bytes.len() {
            return;
        }
        let mut sum = flate2::Crc::new();
        sum.update(&bytes[at + 4..end]);
        bytes[end..end + 4].copy_from_slice(&sum.sum().to_be_bytes());
        at = end + 4;
    }
}

/// E57: the CRC-32C at the end of each page of 1024 bytes.
fn e57(bytes: &mut [u8]) {
    for page in bytes.chunks_exact_mut(1024) {
        let mut sum = !0_u32;
        for &byte in &page[..1020] {
            sum ^= u32::from(byte);
            for _ in 0..8 {
                sum = (sum >> 1) ^ (0x82f6_3b78 & (sum & 1).wrapping_neg());
            }
        }
        page[1020..].copy_from_slice(&(!sum).to_be_bytes());
    }
}
