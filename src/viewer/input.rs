//! What keys and mouse mean. Pure logic.

use super::event::{Button, Key, Modifiers};
use crate::method::Method;
use glam::DVec2;
use std::f64::consts::{FRAC_PI_2, PI};

/// A group of keys with what each does: (heading, [(key, what)]).
pub type KeyGroup = (&'static str, &'static [(&'static str, &'static str)]);

/// Everything that mouse and keys do, as `--help` and the window itself show it.
pub const KEYS: &[KeyGroup] = &[
    (
        "Mouse",
        &[
            ("left drag", "turn about the center of rotation"),
            (
                "right drag, wheel",
                "nearer or farther, to the point under the cursor",
            ),
            ("middle drag, Shift + left drag", "move sideways"),
            (
                "double click",
                "the point under the cursor becomes the center of rotation",
            ),
            ("drop a file", "open a model, or a camera (.json)"),
        ],
    ),
    (
        "View",
        &[
            ("F", "frame the model"),
            ("R", "reset the view"),
            (
                "Numpad 1 3 7",
                "front, right, top; with Ctrl back, left, bottom",
            ),
            (
                "G",
                "fly: W A S D, E up, Q down, Shift faster, wheel sets the speed; G ends it",
            ),
            ("Ctrl C, Ctrl V", "copy or paste the camera as JSON"),
            ("T", "write a turntable of 36 pictures to surfel-turn-NNN"),
        ],
    ),
    (
        "Drawing",
        &[
            (
                "A S D X",
                "all triangles; vertices as points; triangles and splats by size (POP); splats only",
            ),
            (
                "1 to 9",
                "threshold, and size of points and splats, in pixels",
            ),
            ("+ -", "threshold up or down by a quarter of a pixel"),
            ("N, Shift N", "next or previous kind of splat"),
            ("M", "next way of blending"),
            ("K", "next way of reconstructing (visibility splats)"),
            ("J", "light once a splat or once a pixel"),
            (", .", "depth offset smaller, larger"),
            ("O", "depth offset back to the usual one"),
            ("L", "light: a point in the eye, or parallel"),
            ("U", "light both sides, or fronts only"),
            ("V", "vertex colors"),
            ("I", "background: black, gray, white"),
            ("B", "culling of what faces away"),
            (
                "C, Shift C",
                "next or previous coloring: light, primitives, levels, normals, depth",
            ),
            (
                "Y",
                "hold the cut, to look at it from elsewhere; Y lets it go",
            ),
            ("E", "next size metric"),
        ],
    ),
    (
        "Window",
        &[
            ("Tab", "panel"),
            ("? F1", "this list"),
            ("H", "graph of the last frames"),
            ("Z", "freeze the graph"),
            ("F11", "full screen"),
            ("Space", "statistics in the title"),
            ("Enter", "print statistics and the camera"),
            ("P", "write the picture to surfel-NNN.png"),
            ("Backspace", "dismiss messages"),
            ("Esc", "close the list, the message, or the window"),
            ("Q", "quit"),
        ],
    ),
];

/// What the keys do, for `--help`.
pub fn help() -> String {
    let mut out = String::new();
    for (heading, keys) in KEYS {
        out += &format!("{heading} in the window:\n");
        for (key, what) in *keys {
            out += &format!("  {key:<31} {what}\n");
        }
    }
    out.truncate(out.trim_end().len());
    out
}

/// What a key asks for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Command {
    /// Close the window.
    Quit,
    /// Close the list of keys, dismiss the message, stop flying, or close the window.
    Escape,
    /// Draw with another method.
    Method(Method),
    /// Set the threshold, pixels.
    Threshold(f32),
    /// Change the threshold by so many pixels.
    ThresholdBy(f32),
    /// The next (1) or previous (-1) kind of splat.
    Splat(i32),
    /// The next way of blending.
    Blend,
    /// The next way of reconstructing.
    Reconstruction,
    /// Light once a splat or once a pixel.
    Shading,
    /// Multiply the depth offset.
    DepthOffsetBy(f32),
    /// The usual depth offset of the kind of splat.
    UsualDepthOffset,
    /// A point light or parallel light.
    Light,
    /// Light both sides, or fronts only.
    TwoSided,
    /// Switch vertex colors.
    Colors,
    /// The next background.
    Background,
    /// The next size metric.
    SizeMetric,
    /// Switch culling of what faces away.
    Culling,
    /// The next (1) or previous (-1) coloring.
    ColorBy(i32),
    /// Hold the cut of this view, or let it go.
    HoldCut,
    /// Switch the statistics in the title.
    Statistics,
    /// Print statistics and camera.
    Print,
    /// Write a picture.
    Screenshot,
    /// Write pictures from all around.
    Turntable,
    /// Bring the model into the picture.
    Frame,
    /// Back to the first view.
    Reset,
    /// Look from azimuth and elevation, radians.
    LookFrom(f64, f64),
    /// Switch flying.
    Fly,
    /// Copy the camera.
    CopyCamera,
    /// Ask for the text of the clipboard.
    Paste,
    /// Switch the panel.
    Panel,
    /// Switch the list of keys.
    Help,
    /// Switch the graph.
    Graph,
    /// Stop or go on with the graph.
    Freeze,
    /// Switch full screen.
    FullScreen,
    /// Dismiss messages.
    Dismiss,
}

/// Step of the threshold, pixels.
const STEP_PX: f32 = 0.25;
/// Step of the depth offset, a factor.
const OFFSET_STEP: f32 = 1.25;

/// The command of a pressed key; `None` for keys without one. The question mark is a typed character
/// ([`super::event::Event::Text`]), because its place depends on the layout.
pub fn command(key: Key, modifiers: Modifiers) -> Option<Command> {
    let turn = if modifiers.control { PI } else { 0.0 };
    match key {
        Key::Pad(1) => return Some(Command::LookFrom(turn, 0.0)),
        Key::Pad(3) => return Some(Command::LookFrom(FRAC_PI_2 + turn, 0.0)),
        Key::Pad(7) => {
            let elevation = if modifiers.control {
                -FRAC_PI_2
            } else {
                FRAC_PI_2
            };
            return Some(Command::LookFrom(0.0, elevation));
        }
        _ => {}
    }
    if modifiers.other {
        return None;
    }
    if modifiers.control {
        return match key {
            Key::Char('c') => Some(Command::CopyCamera),
            Key::Char('v') => Some(Command::Paste),
            _ => None,
        };
    }
    Some(match key {
        Key::Escape => Command::Escape,
        Key::Enter => Command::Print,
        Key::Space => Command::Statistics,
        Key::Tab => Command::Panel,
        Key::Backspace => Command::Dismiss,
        Key::F(1) => Command::Help,
        Key::F(11) => Command::FullScreen,
        Key::PadAdd => Command::ThresholdBy(STEP_PX),
        Key::PadSubtract => Command::ThresholdBy(-STEP_PX),
        Key::Digit(n @ 1..=9) => Command::Threshold(f32::from(n)),
        Key::Char(c) => match c {
            'a' => Command::Method(Method::Triangles),
            's' => Command::Method(Method::Points),
            'd' => Command::Method(Method::Pop),
            'x' => Command::Method(Method::Splats),
            'n' => Command::Splat(if modifiers.shift { -1 } else { 1 }),
            'm' => Command::Blend,
            'k' => Command::Reconstruction,
            'j' => Command::Shading,
            ',' => Command::DepthOffsetBy(1.0 / OFFSET_STEP),
            '.' => Command::DepthOffsetBy(OFFSET_STEP),
            'o' => Command::UsualDepthOffset,
            'l' => Command::Light,
            'u' => Command::TwoSided,
            'v' => Command::Colors,
            'i' => Command::Background,
            'e' => Command::SizeMetric,
            'b' => Command::Culling,
            'c' => Command::ColorBy(if modifiers.shift { -1 } else { 1 }),
            'y' => Command::HoldCut,
            'f' => Command::Frame,
            'r' => Command::Reset,
            'g' => Command::Fly,
            'h' => Command::Graph,
            'z' => Command::Freeze,
            'p' => Command::Screenshot,
            't' => Command::Turntable,
            'q' => Command::Quit,
            // The plus of many layouts is on the key of the equals sign.
            '+' | '=' => Command::ThresholdBy(STEP_PX),
            '-' => Command::ThresholdBy(-STEP_PX),
            _ => return None,
        },
        _ => return None,
    })
}

/// What a drag does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Drag {
    /// Turns the model.
    Turn,
    /// Moves it sideways.
    Pan,
    /// Moves it nearer or farther.
    Zoom,
}

/// What the mouse asks for; positions in pixels of the picture, y down.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Gesture {
    /// A drag begins at a point.
    Begin(Drag, DVec2),
    /// The drag goes on: by how much.
    Move(Drag, DVec2),
    /// A double click on a point.
    DoubleClick(DVec2),
}

/// Longest time between the clicks of a double click, seconds.
const DOUBLE_CLICK_S: f64 = 0.4;
/// Farthest that a click may move and still be one, pixels.
const CLICK_PX: f64 = 4.0;

/// Turns the events of a mouse into gestures.
#[derive(Debug, Default)]
pub struct Mouse {
    at: DVec2,
    drag: Option<(Button, Drag, DVec2)>,
    last_click: Option<(f64, DVec2)>,
}

impl Mouse {
    /// Where the cursor is.
    pub fn position(&self) -> DVec2 {
        self.at
    }

    /// Whether a button is held.
    pub fn is_dragging(&self) -> bool {
        self.drag.is_some()
    }

    /// The cursor has moved to `at`.
    pub fn moved(&mut self, at: DVec2) -> Option<Gesture> {
        let by = at - self.at;
        self.at = at;
        let (_, drag, _) = self.drag?;
        (by != DVec2::ZERO).then_some(Gesture::Move(drag, by))
    }

    /// A button was pressed or released at `time` seconds.
    pub fn button(
        &mut self,
        button: Button,
        pressed: bool,
        modifiers: Modifiers,
        time: f64,
    ) -> Option<Gesture> {
        if !pressed {
            let (held, _, from) = self.drag?;
            if held == button {
                self.drag = None;
                if button == Button::Left && from.distance(self.at) <= CLICK_PX {
                    self.last_click = Some((time, self.at));
                }
            }
            return None;
        }
        if self.drag.is_some() {
            return None;
        }
        let drag = match button {
            Button::Left if modifiers.shift => Drag::Pan,
            Button::Left => Drag::Turn,
            Button::Right => Drag::Zoom,
            Button::Middle => Drag::Pan,
        };
        if drag == Drag::Turn
            && let Some((before, place)) = self.last_click.take()
            && time - before <= DOUBLE_CLICK_S
            && place.distance(self.at) <= CLICK_PX
        {
            return Some(Gesture::DoubleClick(self.at));
        }
        self.drag = Some((button, drag, self.at));
        Some(Gesture::Begin(drag, self.at))
    }

    /// The window lost its focus: no button counts as held.
    pub fn release(&mut self) {
        self.drag = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NONE: Modifiers = Modifiers {
        shift: false,
        control: false,
        other: false,
    };
    const SHIFT: Modifiers = Modifiers {
        shift: true,
        ..NONE
    };
    const CONTROL: Modifiers = Modifiers {
        control: true,
        ..NONE
    };

    #[test]
    fn the_keys_of_the_thesis_and_their_neighbors() {
        let letter = |c| command(Key::Char(c), NONE);
        assert_eq!(letter('a'), Some(Command::Method(Method::Triangles)));
        assert_eq!(letter('s'), Some(Command::Method(Method::Points)));
        assert_eq!(letter('d'), Some(Command::Method(Method::Pop)));
        assert_eq!(letter('+'), Some(Command::ThresholdBy(0.25)));
        assert_eq!(letter('-'), Some(Command::ThresholdBy(-0.25)));
        assert_eq!(letter('ß'), None);
        assert_eq!(command(Key::Digit(7), NONE), Some(Command::Threshold(7.0)));
        assert_eq!(command(Key::Digit(0), NONE), None);
        assert_eq!(
            command(Key::Pad(7), NONE),
            Some(Command::LookFrom(0.0, FRAC_PI_2))
        );
        assert_eq!(
            command(Key::Pad(7), CONTROL),
            Some(Command::LookFrom(0.0, -FRAC_PI_2))
        );
        assert_eq!(
            command(Key::Char('n'), SHIFT),
            Some(Command::Splat(-1)),
            "backward"
        );
        assert_eq!(command(Key::Char('c'), CONTROL), Some(Command::CopyCamera));
    }

    #[test]
    fn every_key_that_is_listed_has_a_command_of_its_own_and_no_other_letter_has_one() {
        let listed: String = KEYS[1..]
            .iter()
            .flat_map(|(_, keys)| keys.iter())
            .map(|(key, _)| format!("{key} "))
            .collect();
        let words: Vec<&str> = listed.split([' ', ',']).collect();
        let mut commands = Vec::new();
        for c in 'a'..='z' {
            let found = command(Key::Char(c), NONE);
            // Ctrl C and Ctrl V are listed as well; W is a key of flying only.
            let is_listed = words.contains(&c.to_ascii_uppercase().to_string().as_str());
            assert!(found.is_none() || is_listed, "{c} is not listed");
            commands.extend(found);
        }
        for (index, command) in commands.iter().enumerate() {
            assert!(!commands[..index].contains(command), "{command:?} twice");
        }
        for (key, name) in [
            (Key::Tab, "Tab"),
            (Key::F(1), "F1"),
            (Key::F(11), "F11"),
            (Key::Space, "Space"),
            (Key::Enter, "Enter"),
            (Key::Backspace, "Backspace"),
            (Key::Escape, "Esc"),
        ] {
            assert!(command(key, NONE).is_some(), "{key:?}");
            assert!(words.contains(&name), "{name} is not listed");
        }
        assert!(help().contains("F11") && help().contains("turn about"));
        assert!(help().lines().all(|line| line.len() < 130), "{}", help());
    }

    #[test]
    fn shortcuts_of_the_desktop_are_left_alone() {
        let alt = Modifiers {
            other: true,
            ..NONE
        };
        assert_eq!(command(Key::Char('q'), CONTROL), None);
        assert_eq!(command(Key::Digit(1), alt), None);
        assert_eq!(command(Key::Tab, alt), None);
    }

    #[test]
    fn drags_follow_the_button_that_began_them() {
        let mut mouse = Mouse::default();
        let at = DVec2::new(10.0, 20.0);
        assert_eq!(mouse.moved(at), None);
        let press = |m: &mut Mouse, b, mods| m.button(b, true, mods, 0.0);
        assert_eq!(
            press(&mut mouse, Button::Right, NONE),
            Some(Gesture::Begin(Drag::Zoom, at))
        );
        assert_eq!(
            press(&mut mouse, Button::Left, NONE),
            None,
            "one drag at a time"
        );
        assert_eq!(
            mouse.moved(at + DVec2::X),
            Some(Gesture::Move(Drag::Zoom, DVec2::X))
        );
        mouse.button(Button::Left, false, NONE, 0.0);
        assert!(
            mouse.is_dragging(),
            "the other button's release ends nothing"
        );
        mouse.button(Button::Right, false, NONE, 0.0);
        assert!(!mouse.is_dragging());
        assert_eq!(mouse.moved(at), None);
        let with_shift = press(&mut mouse, Button::Left, SHIFT);
        assert_eq!(with_shift, Some(Gesture::Begin(Drag::Pan, at)));
        mouse.release();
        let middle = press(&mut mouse, Button::Middle, NONE);
        assert_eq!(middle, Some(Gesture::Begin(Drag::Pan, at)));
    }

    #[test]
    fn two_quick_clicks_in_one_place_are_a_double_click() {
        let click = |mouse: &mut Mouse, time: f64| {
            let gesture = mouse.button(Button::Left, true, NONE, time);
            mouse.button(Button::Left, false, NONE, time + 0.05);
            gesture
        };
        let turn = Some(Gesture::Begin(Drag::Turn, DVec2::ZERO));
        let mut mouse = Mouse::default();
        assert_eq!(click(&mut mouse, 1.0), turn);
        assert_eq!(
            click(&mut mouse, 1.2),
            Some(Gesture::DoubleClick(DVec2::ZERO))
        );
        assert_eq!(click(&mut mouse, 1.4), turn, "a third click begins anew");
        assert_eq!(click(&mut mouse, 3.0), turn, "too late");
        mouse.moved(DVec2::splat(50.0));
        let elsewhere = Some(Gesture::Begin(Drag::Turn, DVec2::splat(50.0)));
        assert_eq!(click(&mut mouse, 3.1), elsewhere, "elsewhere");
    }
}
