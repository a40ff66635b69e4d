//! Random input for the window, from a seed: what a person might do, and much that nobody would.

use std::path::PathBuf;
use surfel::viewer::event::{KeyModifiers, KeyboardKey, MouseButton, ViewerEvent};
use surfel::viewer::record::RecordEntry;

/// Random numbers by SplitMix64 (Steele, Lea and Flood, 2014): the same on every machine.
#[derive(Debug, Clone)]
pub(crate) struct SeededNumbers(u64);

impl SeededNumbers {
    /// Numbers of a session of a run.
    pub(crate) fn of(seed: u64, session: u64) -> Self {
        let mut numbers = Self(seed ^ session.wrapping_mul(0xd129_0ddf_53c4_3e49));
        numbers.next();
        numbers
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// A number below `count`, which is above 0.
    pub(crate) fn below(&mut self, count: u64) -> u64 {
        self.next() % count
    }

    /// True once in `times`.
    pub(crate) fn once_in(&mut self, times: u64) -> bool {
        self.below(times) == 0
    }

    /// One of `items`, which are not empty.
    pub(crate) fn one<T: Clone>(&mut self, items: &[T]) -> T {
        items[self.below(items.len() as u64) as usize].clone()
    }
}

/// Keys that are pressed: all that mean something but Enter, which prints.
const KEYS: &str = "asdxnmkjluvwiebcyfrghzpt[],.o+-";
const OTHER_KEYS: &[KeyboardKey] = &[
    KeyboardKey::Space,
    KeyboardKey::Tab,
    KeyboardKey::Backspace,
    KeyboardKey::Left,
    KeyboardKey::Right,
    KeyboardKey::Up,
    KeyboardKey::Down,
    KeyboardKey::Home,
    KeyboardKey::End,
    KeyboardKey::PageUp,
    KeyboardKey::PageDown,
    KeyboardKey::Pad(1),
    KeyboardKey::Pad(3),
    KeyboardKey::Pad(7),
    KeyboardKey::PadAdd,
    KeyboardKey::PadSubtract,
    KeyboardKey::F(1),
    KeyboardKey::F(11),
];

/// Writes the events of one session.
struct SessionWriter<'a> {
    numbers: &'a mut SeededNumbers,
    files: &'a [PathBuf],
    entries: Vec<RecordEntry>,
    step: u64,
    time: f64,
    size: (u32, u32),
}

impl SessionWriter<'_> {
    fn add(&mut self, event: ViewerEvent) {
        self.entries.push(RecordEntry {
            step: self.step,
            time: self.time,
            event,
        });
    }

    /// Ends the step after some milliseconds.
    fn go_on(&mut self, most_ms: u64) {
        self.step += 1;
        self.time += self.numbers.below(most_ms) as f64 / 1000.0;
    }

    fn place(&mut self) -> [f64; 2] {
        let (width, height) = self.size;
        [u64::from(width), u64::from(height)].map(|side| self.numbers.below(side) as f64)
    }

    fn resize(&mut self) {
        let most = if self.numbers.once_in(8) { 16 } else { 640 };
        let side = |numbers: &mut SeededNumbers| 1 + numbers.below(most) as u32;
        self.size = (side(self.numbers), side(self.numbers));
        let (width, height) = self.size;
        let scale = self.numbers.one(&[1.0, 1.0, 1.5, 2.0]);
        self.add(ViewerEvent::Size {
            width,
            height,
            scale,
        });
    }

    fn drag(&mut self) {
        use MouseButton::{Left, Middle, Right};
        let button = self.numbers.one(&[Left, Left, Right, Middle]);
        let modifiers = KeyModifiers {
            shift: self.numbers.once_in(5),
            control: self.numbers.once_in(5),
            other: false,
        };
        let press = |pressed| ViewerEvent::Button {
            button,
            pressed,
            modifiers,
        };
        let at = self.place();
        self.add(ViewerEvent::Cursor(at));
        self.add(press(true));
        for _ in 0..self.numbers.below(6) {
            self.go_on(30);
            let at = self.place();
            self.add(ViewerEvent::Cursor(at));
        }
        self.add(press(false));
    }

    fn key(&mut self) {
        let letters: Vec<char> = KEYS.chars().collect();
        let key = match self.numbers.below(5) {
            0 => KeyboardKey::Digit(1 + self.numbers.below(9) as u8),
            1 => self.numbers.one(OTHER_KEYS),
            _ => KeyboardKey::Char(self.numbers.one(&letters)),
        };
        let modifiers = KeyModifiers {
            shift: self.numbers.once_in(4),
            ..KeyModifiers::default()
        };
        for pressed in [true, false] {
            self.add(ViewerEvent::Key {
                key,
                pressed,
                repeat: false,
                modifiers,
            });
        }
    }

    /// Drops a file or several; what was dropped is there some steps later.
    fn drop_files(&mut self) {
        let file = self.numbers.one(self.files);
        if self.numbers.once_in(4) {
            let more = self.numbers.one(self.files);
            self.add(ViewerEvent::DropAll(vec![file.clone(), more]));
        } else {
            self.add(ViewerEvent::Drop(file.clone()));
        }
        if self.numbers.once_in(6) {
            // Another one comes before it is there.
            self.go_on(50);
            self.add(ViewerEvent::Scroll([0.0, 1.0]));
            self.go_on(50);
            return self.drop_files();
        }
        self.go_on(50);
        self.add(ViewerEvent::Loaded(file));
    }

    fn act(&mut self) {
        match self.numbers.below(20) {
            0 => self.resize(),
            1 => self.drop_files(),
            2 => {
                let is_in = self.numbers.once_in(2);
                self.add(ViewerEvent::Focus(is_in));
            }
            3 => self.add(ViewerEvent::CursorGone),
            4 => self.add(ViewerEvent::Paste("no camera".to_owned())),
            5..=7 => {
                let steps = self.numbers.below(7) as f64 - 3.0;
                self.add(ViewerEvent::Scroll([0.0, steps]));
            }
            8..=12 => self.drag(),
            13 => {
                let seconds = self.numbers.below(400) as f64 / 1000.0;
                self.add(ViewerEvent::Tick(seconds));
            }
            _ => self.key(),
        }
        self.go_on(200);
    }
}

/// The input of a session of so many acts, which begins with `first` and may drop any of `files`.
pub(crate) fn session(
    numbers: &mut SeededNumbers,
    first: PathBuf,
    files: &[PathBuf],
    acts: u64,
) -> Vec<RecordEntry> {
    let mut writer = SessionWriter {
        numbers,
        files,
        entries: Vec::new(),
        step: 0,
        time: 0.0,
        size: (320, 240),
    };
    writer.resize();
    writer.add(ViewerEvent::Loaded(first));
    writer.go_on(50);
    for _ in 0..acts {
        writer.act();
    }
    writer.entries
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_seed_does_the_same_and_everything_is_done() {
        let files = ["a.ply", "b.json"].map(PathBuf::from);
        let of = |seed, session_number| {
            let mut numbers = SeededNumbers::of(seed, session_number);
            session(&mut numbers, "first.ply".into(), &files, 400)
        };
        assert_eq!(of(1, 0), of(1, 0));
        assert!(of(1, 0) != of(1, 1) && of(1, 0) != of(2, 0));
        let entries = of(7, 3);
        let has = |is: fn(&ViewerEvent) -> bool| entries.iter().any(|entry| is(&entry.event));
        assert!(has(
            |e| matches!(e, ViewerEvent::Size { width, .. } if *width <= 16)
        ));
        assert!(has(|e| matches!(e, ViewerEvent::DropAll(_))));
        assert!(has(|e| matches!(e, ViewerEvent::Drop(_))));
        assert!(has(|e| matches!(e, ViewerEvent::Loaded(_))));
        assert!(has(|e| matches!(e, ViewerEvent::Tick(_))));
        assert!(entries.windows(2).all(|pair| pair[0].step <= pair[1].step));
        for letter in KEYS.chars() {
            let is_it = |e: &RecordEntry| matches!(&e.event, ViewerEvent::Key { key, .. } if *key == KeyboardKey::Char(letter));
            let sessions = (0..8).flat_map(|number| of(9, number));
            assert!(sessions.into_iter().any(|e| is_it(&e)), "{letter}");
        }
    }
}
