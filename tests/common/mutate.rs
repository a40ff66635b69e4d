//! Damage to files that knows how files are made: whole numbers at aligned places, words and numbers of text, blocks
//! that are repeated, moved, cut off or taken from another file. The same seed gives the same damage on every machine.

#![allow(dead_code, reason = "each test binary uses a part of it")]

/// A generator of numbers, the same on every run (Steele and others, SplitMix64).
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// A number below `bound`, which is at least 1.
    pub(crate) fn below(&mut self, bound: usize) -> usize {
        (self.next() % bound.max(1) as u64) as usize
    }

    fn pick<'a, T>(&mut self, from: &'a [T]) -> &'a T {
        &from[self.below(from.len())]
    }

    /// A length from 1 to `most`, small ones more often.
    fn length(&mut self, most: usize) -> usize {
        let reach = 1 << self.below(12);
        1 + self.below(most.min(reach))
    }
}

/// Numbers that programs forget, as text.
const NUMBERS: &[&str] = &[
    "0",
    "-0",
    "1",
    "-1",
    "2",
    "255",
    "256",
    "65535",
    "65536",
    "2147483647",
    "2147483648",
    "-2147483648",
    "4294967295",
    "4294967296",
    "9223372036854775807",
    "18446744073709551615",
    "99999999999999999999999",
    "1e38",
    "3.5e38",
    "-1e39",
    "1e308",
    "1e400",
    "1e-46",
    "1e-320",
    "0.1",
    ".5",
    "5.",
    "1e",
    "-",
    "",
    "nan",
    "NaN",
    "inf",
    "-inf",
    "0x10",
    "1,5",
    "1_0",
    "+3",
];

/// Damages files of one kind.
pub(crate) struct FileMutator<'a> {
    pub(crate) random: Random,
    /// Words of the format.
    pub(crate) words: &'a [&'a str],
}

impl FileMutator<'_> {
    /// A damaged copy of `bytes`, of at most `most` bytes; `other` is a file to take blocks from.
    pub(crate) fn damaged(&mut self, bytes: &[u8], other: &[u8], most: usize) -> Vec<u8> {
        let mut out = bytes.to_vec();
        let mut steps = 1;
        while steps < 8 && self.random.below(5) < 2 {
            steps += 1;
        }
        let is_text = is_mostly_text(bytes);
        for _ in 0..steps {
            if out.is_empty() {
                out.push(b' ');
            }
            if is_text && self.random.below(3) > 0 {
                self.damage_text(&mut out);
            } else {
                self.damage_bytes(&mut out, other);
            }
        }
        out.truncate(most);
        out
    }

    /// A place; half of the damage goes to the beginning, where the numbers are that ask for memory.
    fn place(&mut self, length: usize) -> usize {
        let reach = if self.random.below(2) == 0 {
            length.min(400)
        } else {
            length
        };
        self.random.below(reach)
    }

    fn damage_bytes(&mut self, out: &mut Vec<u8>, other: &[u8]) {
        let at = self.place(out.len());
        match self.random.below(12) {
            0 => out[at] ^= 1 << self.random.below(8),
            1 => out[at] = self.random.next() as u8,
            2..=4 => self.set_number(out, at),
            5 => self.add_to_number(out, at),
            6 => {
                let length = self.random.length(out.len() - at);
                out.drain(at..at + length);
            }
            7 => {
                let length = self.random.length(out.len() - at);
                let block = out[at..at + length].to_vec();
                let times = 1 + self.random.below(if length < 64 { 40 } else { 3 });
                let to = self.place(out.len());
                out.splice(to..to, block.repeat(times));
            }
            8 => {
                let length = self.random.length(out.len() - at);
                let block = out[at..at + length].to_vec();
                let to = self.place(out.len() - length + 1);
                out[to..to + length].copy_from_slice(&block);
            }
            9 if !other.is_empty() => {
                let from = self.random.below(other.len());
                let length = self.random.length(other.len() - from);
                let end = if self.random.below(2) == 0 {
                    at
                } else {
                    (at + length).min(out.len())
                };
                out.splice(at..end, other[from..from + length].iter().copied());
            }
            10 => out.truncate(self.random.below(out.len() + 1)),
            _ => self.insert_word(out, at),
        }
    }

    fn insert_word(&mut self, out: &mut Vec<u8>, at: usize) {
        if self.words.is_empty() {
            let value = self.random.next() as u8;
            out.insert(at, value);
            return;
        }
        let word = self.random.pick(self.words).as_bytes();
        let end = if self.random.below(2) == 0 {
            at
        } else {
            (at + word.len()).min(out.len())
        };
        out.splice(at..end, word.iter().copied());
    }

    /// Writes a number of 2, 4 or 8 bytes that is at an edge of something, at an aligned place.
    fn set_number(&mut self, out: &mut [u8], at: usize) {
        let size = *self.random.pick(&[2, 4, 4, 4, 8, 8]);
        let at = at / size * size;
        if at + size > out.len() {
            return;
        }
        let length = out.len() as u64;
        let most = u64::MAX >> (64 - 8 * size);
        let value = match self.random.below(16) {
            0 => 0,
            1 => 1,
            2 => most,
            3 => most >> 1,
            4 => (most >> 1) + 1,
            5 => most - 1,
            6 => length,
            7 => length - 1,
            8 => length + 1,
            9 => length - at as u64,
            10 => 1 << self.random.below(8 * size),
            11 => float(f32::NAN, size),
            12 => float(f32::INFINITY, size),
            13 => float(-1e38, size),
            14 => float(1e-42, size),
            _ => self.random.next(),
        };
        self.store(&mut out[at..at + size], value);
    }

    fn store(&mut self, out: &mut [u8], value: u64) {
        let size = out.len();
        out.copy_from_slice(&value.to_le_bytes()[..size]);
        if self.random.below(4) == 0 {
            out.reverse();
        }
    }

    fn add_to_number(&mut self, out: &mut [u8], at: usize) {
        let size = *self.random.pick(&[1, 2, 4, 8]);
        let at = at / size * size;
        if at + size > out.len() {
            return;
        }
        let part = &mut out[at..at + size];
        let mut buffer = [0; 8];
        buffer[..size].copy_from_slice(part);
        let step = 1 + self.random.below(35) as u64;
        let value = u64::from_le_bytes(buffer);
        let value = if self.random.below(2) == 0 {
            value.wrapping_add(step)
        } else {
            value.wrapping_sub(step)
        };
        part.copy_from_slice(&value.to_le_bytes()[..size]);
    }

    fn damage_text(&mut self, out: &mut Vec<u8>) {
        let at = self.place(out.len());
        match self.random.below(8) {
            0..=2 => {
                let number = self.random.pick(NUMBERS).as_bytes();
                replace(out, at, number, |b| {
                    b.is_ascii_digit() || b"+-.eE".contains(&b)
                });
            }
            3 if !self.words.is_empty() => {
                let word = self.random.pick(self.words).as_bytes();
                replace(out, at, word, |b| {
                    !b.is_ascii_whitespace() && !b"{}[]<>,:".contains(&b)
                });
            }
            4 => self.insert_word(out, at),
            5 => {
                // A line, not there or there many times.
                let line = line_at(out, at);
                let times = *self.random.pick(&[0, 2, 3, 30]);
                let block = out[line.clone()].repeat(times);
                out.splice(line, block);
            }
            6 => {
                let from = line_at(out, at);
                let block = out[from].to_vec();
                let place = self.place(out.len());
                let to = line_at(out, place).start;
                out.splice(to..to, block);
            }
            _ => {
                let byte = *self.random.pick(b"0123456789 -.#/\n\r\\e\"',;:[]{}<>\t\0");
                if self.random.below(2) == 0 {
                    out[at] = byte;
                } else {
                    out.insert(at, byte);
                }
            }
        }
    }
}

/// The bits of a number of `size` bytes.
fn float(value: f32, size: usize) -> u64 {
    match size {
        8 => f64::from(value).to_bits(),
        4 => u64::from(value.to_bits()),
        _ => u64::from(value.to_bits() >> 16),
    }
}

/// Replaces the run of bytes of a kind at or after a place.
fn replace(out: &mut Vec<u8>, at: usize, with: &[u8], is_kind: impl Fn(u8) -> bool) {
    let Some(inside) = out[at..].iter().position(|&b| is_kind(b)) else {
        return;
    };
    let inside = at + inside;
    let before = out[..inside].iter().rev().take_while(|b| is_kind(**b));
    let start = inside - before.count();
    let end = inside + out[inside..].iter().take_while(|b| is_kind(**b)).count();
    out.splice(start..end, with.iter().copied());
}

/// The line around a place, with its end.
fn line_at(out: &[u8], at: usize) -> std::ops::Range<usize> {
    let start = out[..at]
        .iter()
        .rposition(|&b| b == b'\n')
        .map_or(0, |e| e + 1);
    let end = out[at..].iter().position(|&b| b == b'\n');
    start..end.map_or(out.len(), |e| at + e + 1)
}

/// Whether a file has hardly a byte that text has not.
pub(crate) fn is_mostly_text(bytes: &[u8]) -> bool {
    let odd = |b: &&u8| **b == 0 || (**b < 0x20 && !b.is_ascii_whitespace()) || **b >= 0x80;
    bytes.iter().take(4096).filter(odd).count() * 50 < bytes.len().clamp(1, 4096)
}
