//! What keys and mouse mean. Pure logic on the window system's events.

use crate::method::Method;
use glam::DVec2;
use glfw::{Action, Key, Modifiers, MouseButton};
use std::f64::consts::{FRAC_PI_2, PI};

/// What the keys do, for `--help`.
pub const HELP: &str = "\
Mouse in the window:
  left drag           turn about the center of rotation (at first the model's middle)
  right drag, wheel   nearer or farther, to the point under the cursor
  middle drag, shift + left drag   move sideways
  double click        make the point under the cursor the center of rotation
  drop a file         open it
Keys in the window:
  A S D     all triangles, vertices as points, points and triangles by size (POP)
  1 to 9    threshold, and size of points and splats, in pixels
  + -       threshold up or down by a quarter of a pixel
  B C       back-face culling; colors by primitive (splats red, triangles blue)
  F R       frame the model; reset the view
  numpad 1 3 7   front, right, top; with Ctrl back, left, bottom
  Space     statistics in the title on or off
  Enter     print statistics and the camera
  P         write the picture to surfel-NNN.png
  Esc Q     quit";

/// What a key asks for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Command {
    /// Close the window.
    Quit,
    /// Draw with another method.
    Method(Method),
    /// Set the threshold, pixels.
    Threshold(f32),
    /// Change the threshold by so many pixels.
    ThresholdBy(f32),
    /// Switch culling of what faces away.
    Culling,
    /// Switch coloring by primitive.
    Primitive,
    /// Switch the statistics in the title.
    Statistics,
    /// Print statistics and camera.
    Print,
    /// Write a picture.
    Screenshot,
    /// Bring the model into the picture.
    Frame,
    /// Back to the first view.
    Reset,
    /// Look from azimuth and elevation, radians.
    LookFrom(f64, f64),
}

/// Step of the threshold, pixels.
const STEP_PX: f32 = 0.25;

/// The command of a pressed key. `name` is what the keyboard's layout prints for the key, so that letters are
/// found where the user sees them; digits go by place, so that no shift is needed for them.
pub fn command(key: Key, name: Option<&str>, modifiers: Modifiers) -> Option<Command> {
    let has_control = modifiers.contains(Modifiers::Control);
    let turn = if has_control { PI } else { 0.0 };
    match key {
        Key::Kp1 => return Some(Command::LookFrom(turn, 0.0)),
        Key::Kp3 => return Some(Command::LookFrom(FRAC_PI_2 + turn, 0.0)),
        Key::Kp7 => {
            return Some(Command::LookFrom(
                0.0,
                if has_control { -FRAC_PI_2 } else { FRAC_PI_2 },
            ));
        }
        _ => {}
    }
    if has_control || modifiers.intersects(Modifiers::Alt | Modifiers::Super) {
        return None;
    }
    let digit = |n: u8| Some(Command::Threshold(f32::from(n)));
    match key {
        Key::Escape => return Some(Command::Quit),
        Key::Enter | Key::KpEnter => return Some(Command::Print),
        Key::Space => return Some(Command::Statistics),
        Key::KpAdd => return Some(Command::ThresholdBy(STEP_PX)),
        Key::KpSubtract => return Some(Command::ThresholdBy(-STEP_PX)),
        Key::Num1 => return digit(1),
        Key::Num2 => return digit(2),
        Key::Num3 => return digit(3),
        Key::Num4 => return digit(4),
        Key::Num5 => return digit(5),
        Key::Num6 => return digit(6),
        Key::Num7 => return digit(7),
        Key::Num8 => return digit(8),
        Key::Num9 => return digit(9),
        _ => {}
    }
    match name?.to_lowercase().as_str() {
        "a" => Some(Command::Method(Method::Triangles)),
        "s" => Some(Command::Method(Method::Points)),
        "d" => Some(Command::Method(Method::Pop)),
        "b" => Some(Command::Culling),
        "c" => Some(Command::Primitive),
        "f" => Some(Command::Frame),
        "r" => Some(Command::Reset),
        "p" => Some(Command::Screenshot),
        "q" => Some(Command::Quit),
        // The plus of many layouts is on the key of the equals sign.
        "+" | "=" => Some(Command::ThresholdBy(STEP_PX)),
        "-" => Some(Command::ThresholdBy(-STEP_PX)),
        _ => None,
    }
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
    drag: Option<(MouseButton, Drag, DVec2)>,
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
        button: MouseButton,
        action: Action,
        modifiers: Modifiers,
        time: f64,
    ) -> Option<Gesture> {
        if action != Action::Press {
            let (held, _, from) = self.drag?;
            if held == button {
                self.drag = None;
                if button == glfw::MouseButtonLeft && from.distance(self.at) <= CLICK_PX {
                    self.last_click = Some((time, self.at));
                }
            }
            return None;
        }
        if self.drag.is_some() {
            return None;
        }
        let drag = match button {
            glfw::MouseButtonLeft if modifiers.contains(Modifiers::Shift) => Drag::Pan,
            glfw::MouseButtonLeft => Drag::Turn,
            glfw::MouseButtonRight => Drag::Zoom,
            glfw::MouseButtonMiddle => Drag::Pan,
            _ => return None,
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

    const NONE: Modifiers = Modifiers::empty();

    #[test]
    fn every_documented_key_has_its_command() {
        let letter = |name| command(Key::Unknown, Some(name), NONE);
        assert_eq!(letter("a"), Some(Command::Method(Method::Triangles)));
        assert_eq!(letter("S"), Some(Command::Method(Method::Points)));
        assert_eq!(letter("d"), Some(Command::Method(Method::Pop)));
        assert_eq!(letter("b"), Some(Command::Culling));
        assert_eq!(letter("c"), Some(Command::Primitive));
        assert_eq!(letter("f"), Some(Command::Frame));
        assert_eq!(letter("r"), Some(Command::Reset));
        assert_eq!(letter("p"), Some(Command::Screenshot));
        assert_eq!(letter("q"), Some(Command::Quit));
        assert_eq!(letter("+"), Some(Command::ThresholdBy(0.25)));
        assert_eq!(letter("-"), Some(Command::ThresholdBy(-0.25)));
        assert_eq!(letter("x"), None);
        assert_eq!(command(Key::Escape, None, NONE), Some(Command::Quit));
        assert_eq!(command(Key::Enter, None, NONE), Some(Command::Print));
        assert_eq!(
            command(Key::Space, Some(" "), NONE),
            Some(Command::Statistics)
        );
        assert_eq!(
            command(Key::Num7, Some("&"), NONE),
            Some(Command::Threshold(7.0))
        );
        assert_eq!(
            command(Key::Kp7, Some("7"), NONE),
            Some(Command::LookFrom(0.0, FRAC_PI_2))
        );
        let opposite = command(Key::Kp7, Some("7"), Modifiers::Control);
        assert_eq!(opposite, Some(Command::LookFrom(0.0, -FRAC_PI_2)));
    }

    #[test]
    fn letters_go_by_the_layout_and_shortcuts_of_the_desktop_are_left_alone() {
        // The key left of S prints Q on a French keyboard and must not quit where A is seen.
        assert_eq!(
            command(Key::Q, Some("a"), NONE),
            Some(Command::Method(Method::Triangles))
        );
        assert_eq!(command(Key::Q, Some("q"), Modifiers::Control), None);
        assert_eq!(command(Key::Num1, Some("1"), Modifiers::Alt), None);
    }

    #[test]
    fn drags_follow_the_button_that_began_them() {
        let mut mouse = Mouse::default();
        let at = DVec2::new(10.0, 20.0);
        assert_eq!(mouse.moved(at), None);
        let press = |m: &mut Mouse, b, mods| m.button(b, Action::Press, mods, 0.0);
        assert_eq!(
            press(&mut mouse, glfw::MouseButtonRight, NONE),
            Some(Gesture::Begin(Drag::Zoom, at))
        );
        assert_eq!(
            press(&mut mouse, glfw::MouseButtonLeft, NONE),
            None,
            "one drag at a time"
        );
        assert_eq!(
            mouse.moved(at + DVec2::X),
            Some(Gesture::Move(Drag::Zoom, DVec2::X))
        );
        mouse.button(glfw::MouseButtonLeft, Action::Release, NONE, 0.0);
        assert!(
            mouse.is_dragging(),
            "the other button's release ends nothing"
        );
        mouse.button(glfw::MouseButtonRight, Action::Release, NONE, 0.0);
        assert!(!mouse.is_dragging());
        assert_eq!(mouse.moved(at), None);
        let with_shift = press(&mut mouse, glfw::MouseButtonLeft, Modifiers::Shift);
        assert_eq!(with_shift, Some(Gesture::Begin(Drag::Pan, at)));
        mouse.release();
        let middle = press(&mut mouse, glfw::MouseButtonMiddle, NONE);
        assert_eq!(middle, Some(Gesture::Begin(Drag::Pan, at)));
    }

    #[test]
    fn two_quick_clicks_in_one_place_are_a_double_click() {
        let click = |mouse: &mut Mouse, time: f64| {
            let gesture = mouse.button(glfw::MouseButtonLeft, Action::Press, NONE, time);
            mouse.button(glfw::MouseButtonLeft, Action::Release, NONE, time + 0.05);
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
