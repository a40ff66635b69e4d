//! What keys and mouse mean. Pure logic.

use super::event::{KeyModifiers, KeyboardKey, MouseButton};
use super::lamp::LampChange;
use crate::render::Method;
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
            ("Ctrl + left drag", "move the lamp, which turns it on"),
            (
                "double click",
                "the point under the cursor becomes the center of rotation",
            ),
            ("drop a file", "open a model or a scan, or a camera (.json)"),
        ],
    ),
    (
        "View",
        &[
            ("F", "frame the model"),
            ("R", "reset the view"),
            ("Shift U", "the next axis is up: y, z, x"),
            ("F5, Ctrl R", "open the files again, seen as before"),
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
            ("Shift D", "splats at vertices, cut at sharp edges; or not"),
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
            ("V", "vertex colors"),
            ("Shift V", "photographs on the model"),
            (
                "[ ]",
                "look from where the previous or next photograph was taken (or click on its pose)",
            ),
            ("I", "background: black, gray, white, gradient"),
            ("Shift Z, Shift X", "scale bar; axes"),
            ("B", "culling of what faces away"),
            ("Shift B", "darken what lies behind its neighbors"),
            ("Shift A", "darken what lies deep between its surroundings"),
            (
                "C, Shift C",
                "next or previous coloring: light, primitives, levels, normals, depth, overdraw",
            ),
            (
                "Y",
                "hold the cut, to look at it from elsewhere; Y lets it go",
            ),
            (
                "Shift Y",
                "section: cut away the nearer half, or nothing again",
            ),
            (
                "Ctrl K",
                "all points, or again those that the panel's conditions keep",
            ),
            ("Ctrl A", "color points by the next of what they carry"),
            ("E", "next size metric"),
        ],
    ),
    (
        "Light",
        &[
            ("L", "next light: eye, parallel, lamp, studio, materials"),
            (
                "Shift L",
                "the lamp goes with the viewer, or stays in the world",
            ),
            ("Arrows", "move the lamp left, right, up, down"),
            (
                "Page Up, Page Down",
                "a lamp in the world farther away, nearer",
            ),
            ("Home, End", "stronger, weaker highlights"),
            ("Shift Home, Shift End", "smaller, larger highlights"),
            (
                "Ctrl Home, Ctrl End",
                "more, less of the lamp's light from everywhere",
            ),
            ("U", "light both sides, or fronts only"),
            (
                "Shift S",
                "other normals: the file's, computed smooth, flat; opens the files again",
            ),
        ],
    ),
    (
        "Measuring",
        &[
            (
                "Ctrl + Shift + left click",
                "measure: the visible point under the cursor is the next of the line",
            ),
            ("Ctrl N", "the next point begins another line"),
            (
                "Ctrl J",
                "join the last point to the first: an area; or not",
            ),
            ("Ctrl Z", "take the last point away"),
            ("Ctrl S", "write all measures to surfel-measures-NNN.json"),
            (
                "Ctrl I",
                "show the point under the cursor: place and attributes",
            ),
        ],
    ),
    (
        "Window",
        &[
            ("Tab", "panel"),
            ("? F1", "this list"),
            ("H", "graph of the last frames"),
            ("Z", "freeze the graph"),
            (
                "W, Shift W",
                "next or previous time that frames are held to while the view moves: none, 16, 33, 50, 100 ms",
            ),
            ("F11", "full screen"),
            ("Space", "statistics in the title"),
            ("Enter", "print statistics and the camera"),
            ("P", "write the picture to surfel-NNN.png"),
            (
                "Shift P",
                "write a photo to surfel-photo-NNN.png: twice as wide and high, 16 samples a pixel",
            ),
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
pub enum KeyCommand {
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
    /// Show all again, or the part that was kept before.
    Keep,
    /// Color points by the next of what they carry.
    PointColors,
    /// The next light: in the eye, parallel, the lamp.
    Light,
    /// Change the lamp, and turn it on.
    Lamp(LampChange),
    /// The next (1) or previous (-1) wanted time of frames.
    FrameTime(i32),
    /// Light both sides, or fronts only.
    TwoSided,
    /// The next normals of surfaces: opens the files again.
    Normals,
    /// The next axis that is up.
    Up,
    /// Switch vertex colors.
    Colors,
    /// The next background.
    Background,
    /// The next size metric.
    SizeMetric,
    /// Switch splats from vertices.
    VertexSplats,
    /// Switch culling of what faces away.
    Culling,
    /// The next kind of eye-dome lighting.
    EyeDome,
    /// The next kind of ambient occlusion.
    AmbientOcclusion,
    /// Switch the bar that tells lengths.
    ScaleBar,
    /// Switch the axes.
    Axes,
    /// The next (1) or previous (-1) coloring.
    ColorBy(i32),
    /// Switch photographs on the model.
    Photographs,
    /// Look from the pose of the next (1) or previous (-1) photograph.
    PhotographBy(i64),
    /// Something of measures.
    Measure(MeasureChange),
    /// Hold the cut of this view, or let it go.
    HoldCut,
    /// Cut away the nearer half of the model, or nothing again.
    Section,
    /// Switch the statistics in the title.
    Statistics,
    /// Print statistics and camera.
    Print,
    /// Write a picture.
    Screenshot,
    /// Write a larger and smoother one.
    Photo,
    /// Write pictures from all around.
    Turntable,
    /// Bring the model into the picture.
    Frame,
    /// Back to the first view.
    Reset,
    /// Open the files again.
    Reload,
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

/// What a key does to measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MeasureChange {
    /// Show what is under the cursor, or do not.
    PointInfo,
    /// The next point begins another line.
    End,
    /// Join the last point to the first, or not.
    Close,
    /// Take the last point away.
    Undo,
    /// Write all to a file.
    Save,
}

/// Step of the threshold, pixels.
const STEP_PX: f32 = 0.25;
/// Step of the depth offset, a factor.
const OFFSET_STEP: f32 = 1.25;

/// Step of the lamp, degrees.
const LAMP_STEP: f64 = 5.0;
/// Step of its distance and of the exponent of highlights, factors.
const DISTANCE_STEP: f64 = 1.25;
const SHININESS_STEP: f32 = 1.25;
/// Step of the parts of its light.
const PART_STEP: f32 = 0.05;

/// What a key does to the lamp.
fn lamp_change(key: KeyboardKey, modifiers: KeyModifiers) -> Option<LampChange> {
    let KeyModifiers { shift, control, .. } = modifiers;
    let change = match key {
        KeyboardKey::Home | KeyboardKey::End => {
            let is_up = key == KeyboardKey::Home;
            let part = if is_up { PART_STEP } else { -PART_STEP };
            return match (shift, control) {
                (false, false) => Some(LampChange::Specular(part)),
                (true, false) if is_up => Some(LampChange::Shininess(SHININESS_STEP)),
                (true, false) => Some(LampChange::Shininess(1.0 / SHININESS_STEP)),
                (false, true) => Some(LampChange::Ambient(part)),
                (true, true) => None,
            };
        }
        KeyboardKey::Left => LampChange::Turn(-LAMP_STEP, 0.0),
        KeyboardKey::Right => LampChange::Turn(LAMP_STEP, 0.0),
        KeyboardKey::Up => LampChange::Turn(0.0, LAMP_STEP),
        KeyboardKey::Down => LampChange::Turn(0.0, -LAMP_STEP),
        KeyboardKey::PageUp => LampChange::Distance(DISTANCE_STEP),
        KeyboardKey::PageDown => LampChange::Distance(1.0 / DISTANCE_STEP),
        _ => return None,
    };
    (!control).then_some(change)
}

/// The command of a pressed key; `None` for keys without one. The question mark is a typed character
/// ([`super::event::ViewerEvent::Text`]), because its place depends on the layout.
pub fn command(key: KeyboardKey, modifiers: KeyModifiers) -> Option<KeyCommand> {
    let turn = if modifiers.control { PI } else { 0.0 };
    match key {
        KeyboardKey::Pad(1) => return Some(KeyCommand::LookFrom(turn, 0.0)),
        KeyboardKey::Pad(3) => return Some(KeyCommand::LookFrom(FRAC_PI_2 + turn, 0.0)),
        KeyboardKey::Pad(7) => {
            let elevation = if modifiers.control {
                -FRAC_PI_2
            } else {
                FRAC_PI_2
            };
            return Some(KeyCommand::LookFrom(0.0, elevation));
        }
        _ => {}
    }
    if modifiers.other {
        return None;
    }
    if let Some(change) = lamp_change(key, modifiers) {
        return Some(KeyCommand::Lamp(change));
    }
    if modifiers.control {
        return match key {
            KeyboardKey::Char('c') => Some(KeyCommand::CopyCamera),
            KeyboardKey::Char('v') => Some(KeyCommand::Paste),
            KeyboardKey::Char('r') => Some(KeyCommand::Reload),
            KeyboardKey::Char('k') => Some(KeyCommand::Keep),
            KeyboardKey::Char('a') => Some(KeyCommand::PointColors),
            KeyboardKey::Char('i') => Some(KeyCommand::Measure(MeasureChange::PointInfo)),
            KeyboardKey::Char('n') => Some(KeyCommand::Measure(MeasureChange::End)),
            KeyboardKey::Char('j') => Some(KeyCommand::Measure(MeasureChange::Close)),
            KeyboardKey::Char('z') => Some(KeyCommand::Measure(MeasureChange::Undo)),
            KeyboardKey::Char('s') => Some(KeyCommand::Measure(MeasureChange::Save)),
            _ => None,
        };
    }
    Some(match key {
        KeyboardKey::Escape => KeyCommand::Escape,
        KeyboardKey::Enter => KeyCommand::Print,
        KeyboardKey::Space => KeyCommand::Statistics,
        KeyboardKey::Tab => KeyCommand::Panel,
        KeyboardKey::Backspace => KeyCommand::Dismiss,
        KeyboardKey::F(1) => KeyCommand::Help,
        KeyboardKey::F(5) => KeyCommand::Reload,
        KeyboardKey::F(11) => KeyCommand::FullScreen,
        KeyboardKey::PadAdd => KeyCommand::ThresholdBy(STEP_PX),
        KeyboardKey::PadSubtract => KeyCommand::ThresholdBy(-STEP_PX),
        KeyboardKey::Digit(n @ 1..=9) => KeyCommand::Threshold(f32::from(n)),
        KeyboardKey::Char(c) => match c {
            'a' if modifiers.shift => KeyCommand::AmbientOcclusion,
            'a' => KeyCommand::Method(Method::Triangles),
            's' if modifiers.shift => KeyCommand::Normals,
            's' => KeyCommand::Method(Method::Points),
            'd' if modifiers.shift => KeyCommand::VertexSplats,
            'd' => KeyCommand::Method(Method::Pop),
            'x' if modifiers.shift => KeyCommand::Axes,
            'z' if modifiers.shift => KeyCommand::ScaleBar,
            'x' => KeyCommand::Method(Method::Splats),
            'n' => KeyCommand::Splat(if modifiers.shift { -1 } else { 1 }),
            'm' => KeyCommand::Blend,
            'k' => KeyCommand::Reconstruction,
            'j' => KeyCommand::Shading,
            ',' => KeyCommand::DepthOffsetBy(1.0 / OFFSET_STEP),
            '.' => KeyCommand::DepthOffsetBy(OFFSET_STEP),
            'o' => KeyCommand::UsualDepthOffset,
            'l' if modifiers.shift => KeyCommand::Lamp(LampChange::Anchor),
            'l' => KeyCommand::Light,
            'w' => KeyCommand::FrameTime(if modifiers.shift { -1 } else { 1 }),
            'u' if modifiers.shift => KeyCommand::Up,
            'u' => KeyCommand::TwoSided,
            'v' if modifiers.shift => KeyCommand::Photographs,
            'v' => KeyCommand::Colors,
            '[' => KeyCommand::PhotographBy(-1),
            ']' => KeyCommand::PhotographBy(1),
            'i' => KeyCommand::Background,
            'e' => KeyCommand::SizeMetric,
            'b' if modifiers.shift => KeyCommand::EyeDome,
            'b' => KeyCommand::Culling,
            'c' => KeyCommand::ColorBy(if modifiers.shift { -1 } else { 1 }),
            'y' if modifiers.shift => KeyCommand::Section,
            'y' => KeyCommand::HoldCut,
            'f' => KeyCommand::Frame,
            'r' => KeyCommand::Reset,
            'g' => KeyCommand::Fly,
            'h' => KeyCommand::Graph,
            'z' => KeyCommand::Freeze,
            'p' if modifiers.shift => KeyCommand::Photo,
            'p' => KeyCommand::Screenshot,
            't' => KeyCommand::Turntable,
            'q' => KeyCommand::Quit,
            // The plus of many layouts is on the key of the equals sign.
            '+' | '=' => KeyCommand::ThresholdBy(STEP_PX),
            '-' => KeyCommand::ThresholdBy(-STEP_PX),
            _ => return None,
        },
        _ => return None,
    })
}

/// What a drag does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DragAction {
    /// Turns the model.
    Turn,
    /// Moves it sideways.
    Pan,
    /// Moves it nearer or farther.
    Zoom,
    /// Moves the lamp.
    Lamp,
}

/// What the mouse asks for; positions in pixels of the picture, y down.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum MouseGesture {
    /// A drag begins at a point.
    Begin(DragAction, DVec2),
    /// The drag goes on: by how much.
    Move(DragAction, DVec2),
    /// A click on a point, once the button is let go.
    Click(DVec2),
    /// A double click on a point, when the button goes down again.
    DoubleClick(DVec2),
    /// A click on a point to be measured.
    Measure(DVec2),
}

/// Longest time between the clicks of a double click, seconds.
const DOUBLE_CLICK_S: f64 = 0.4;
/// Farthest that a click may move and still be one, pixels.
const CLICK_PX: f64 = 4.0;

/// Turns the events of a mouse into gestures.
#[derive(Debug, Default)]
pub struct MouseState {
    at: DVec2,
    drag: Option<(MouseButton, DragAction, DVec2)>,
    last_click: Option<(f64, DVec2)>,
}

impl MouseState {
    /// Where the cursor is.
    pub fn position(&self) -> DVec2 {
        self.at
    }

    /// The cursor has moved to `at`.
    pub fn moved(&mut self, at: DVec2) -> Option<MouseGesture> {
        let by = at - self.at;
        self.at = at;
        let (_, drag, _) = self.drag?;
        (by != DVec2::ZERO).then_some(MouseGesture::Move(drag, by))
    }

    /// A button was pressed or released at `time` seconds.
    pub fn button(
        &mut self,
        button: MouseButton,
        pressed: bool,
        modifiers: KeyModifiers,
        time: f64,
    ) -> Option<MouseGesture> {
        if !pressed {
            let (held, drag, from) = self.drag?;
            if held == button {
                self.drag = None;
                if button == MouseButton::Left && from.distance(self.at) <= CLICK_PX {
                    self.last_click = Some((time, self.at));
                    return (drag == DragAction::Turn).then_some(MouseGesture::Click(self.at));
                }
            }
            return None;
        }
        if self.drag.is_some() {
            return None;
        }
        if button == MouseButton::Left && modifiers.control && modifiers.shift {
            return Some(MouseGesture::Measure(self.at));
        }
        let drag = match button {
            MouseButton::Left if modifiers.control => DragAction::Lamp,
            MouseButton::Left if modifiers.shift => DragAction::Pan,
            MouseButton::Left => DragAction::Turn,
            MouseButton::Right => DragAction::Zoom,
            MouseButton::Middle => DragAction::Pan,
        };
        if drag == DragAction::Turn
            && let Some((before, place)) = self.last_click.take()
            && time - before <= DOUBLE_CLICK_S
            && place.distance(self.at) <= CLICK_PX
        {
            return Some(MouseGesture::DoubleClick(self.at));
        }
        self.drag = Some((button, drag, self.at));
        Some(MouseGesture::Begin(drag, self.at))
    }

    /// The window lost its focus: no button counts as held.
    pub fn release(&mut self) {
        self.drag = None;
    }
}

#[cfg(test)]
mod tests;
