//! What happens to the window, in words of our own: the window system's events are translated once, and a recording
//! is a list of these.

use super::control::{FrameWork, TimeTaken};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// A key. Letters and signs go by what the keyboard's layout prints, so that they are found where the user sees
/// them; digits go by place, so that no shift is needed for them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum KeyboardKey {
    /// What the layout prints for it, in lower case.
    Char(char),
    /// A digit above the letters.
    Digit(u8),
    /// A digit of the number pad.
    Pad(u8),
    /// Plus of the number pad.
    PadAdd,
    /// Minus of the number pad.
    PadSubtract,
    /// A function key.
    F(u8),
    /// Either Enter.
    Enter,
    /// Escape.
    Escape,
    /// The space bar.
    Space,
    /// Tab.
    Tab,
    /// Backspace.
    Backspace,
    /// Delete.
    Delete,
    /// Home.
    Home,
    /// End.
    End,
    /// Page up.
    PageUp,
    /// Page down.
    PageDown,
    /// Arrow to the left.
    Left,
    /// Arrow to the right.
    Right,
    /// Arrow up.
    Up,
    /// Arrow down.
    Down,
}

/// A button of the mouse.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MouseButton {
    /// The main one.
    Left,
    /// The other one.
    Right,
    /// The wheel.
    Middle,
}

/// Keys that change the meaning of others.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct KeyModifiers {
    /// Shift.
    #[serde(skip_serializing_if = "is_off")]
    pub shift: bool,
    /// Control.
    #[serde(skip_serializing_if = "is_off")]
    pub control: bool,
    /// Alt or the window system's own key: shortcuts of the desktop.
    #[serde(skip_serializing_if = "is_off")]
    pub other: bool,
}

// The signature is serde's.
#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde asks for it")]
fn is_off(value: &bool) -> bool {
    !*value
}

/// Something that happened. Positions are pixels of the picture, y down.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ViewerEvent {
    /// The picture has this many pixels, and so many pixels make one point of the panel.
    Size {
        /// Pixels.
        width: u32,
        /// Pixels.
        height: u32,
        /// Pixels for one point; above 0.
        scale: f32,
    },
    /// The window opened with the panel or without.
    Panel(bool),
    /// The window got or lost the keyboard.
    Focus(bool),
    /// The cursor moved here.
    Cursor([f64; 2]),
    /// The cursor left the window.
    CursorGone,
    /// A button went down or up.
    Button {
        /// Which.
        button: MouseButton,
        /// Down.
        pressed: bool,
        /// Held meanwhile.
        #[serde(default)]
        modifiers: KeyModifiers,
    },
    /// The wheel turned: steps to the right and away from the user.
    Scroll([f64; 2]),
    /// A key went down, goes on being down, or went up.
    Key {
        /// Which.
        key: KeyboardKey,
        /// Down.
        pressed: bool,
        /// Still down.
        #[serde(default, skip_serializing_if = "is_off")]
        repeat: bool,
        /// Held meanwhile.
        #[serde(default)]
        modifiers: KeyModifiers,
    },
    /// A character was typed.
    Text(char),
    /// A text was pasted.
    Paste(String),
    /// A file was dropped.
    Drop(PathBuf),
    /// Several files were dropped: they are shown together.
    DropAll(Vec<PathBuf>),
    /// A coarse preview of a model that is being loaded has come.
    Preview(PathBuf),
    /// A model has been loaded, or could not be.
    Loaded(PathBuf),
    /// So many seconds passed in which something moves by itself.
    Tick(f64),
    /// A frame of the model has finished.
    Frame {
        /// Work of the frame, milliseconds.
        ms: f64,
        /// The threshold that it was drawn with, pixels.
        threshold_px: f32,
        /// What it drew.
        #[serde(default)]
        drew: FrameWork,
        /// Work of the frame in parts; recordings of versions before 2026-11-22 have none.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        parts: Option<TimeTaken>,
    },
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests may panic")]

    use super::*;

    #[test]
    fn events_survive_a_recording() {
        let shift = KeyModifiers {
            shift: true,
            ..KeyModifiers::default()
        };
        for (event, text) in [
            (ViewerEvent::Cursor([1.5, -2.0]), r#"{"cursor":[1.5,-2.0]}"#),
            (
                ViewerEvent::Key {
                    key: KeyboardKey::Char('ä'),
                    pressed: true,
                    repeat: false,
                    modifiers: shift,
                },
                r#"{"key":{"key":{"char":"ä"},"pressed":true,"modifiers":{"shift":true}}}"#,
            ),
            (ViewerEvent::CursorGone, r#""cursor_gone""#),
            (ViewerEvent::Tick(0.1), r#"{"tick":0.1}"#),
            (ViewerEvent::Drop("a b.ply".into()), r#"{"drop":"a b.ply"}"#),
            (
                ViewerEvent::DropAll(vec!["a.ply".into(), "b.ply".into()]),
                r#"{"drop_all":["a.ply","b.ply"]}"#,
            ),
        ] {
            assert_eq!(serde_json::to_string(&event).unwrap(), text);
            assert_eq!(serde_json::from_str::<ViewerEvent>(text).unwrap(), event);
        }
        let short = r#"{"key":{"key":"escape","pressed":true}}"#;
        assert!(
            serde_json::from_str::<ViewerEvent>(short).is_ok(),
            "{short}"
        );
    }
}
