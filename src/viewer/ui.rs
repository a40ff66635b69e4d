//! egui in this window: our events in, triangles out. Knows neither the window system nor Vulkan.

use super::event::{KeyModifiers, KeyboardKey, MouseButton, ViewerEvent};
use egui::{Order, Pos2, RawInput, Rect, Ui, pos2, vec2};

/// What a pass of egui gave.
#[derive(Debug, Default)]
pub struct PaintedOverlay {
    /// Triangles, in points.
    pub primitives: Vec<egui::ClippedPrimitive>,
    /// Changes of textures; every one must reach the device.
    pub textures: egui::TexturesDelta,
    /// Pixels for one point.
    pub pixels_per_point: f32,
    /// Seconds until it wants to be shown again by itself.
    pub again_in: Option<f64>,
    /// Text for the clipboard.
    pub copied: Option<String>,
}

/// The state of egui between two frames.
#[derive(Debug)]
pub struct PanelInterface {
    context: egui::Context,
    input: RawInput,
    size: (u32, u32),
    scale: f32,
    /// Where the cursor is, points.
    cursor: Option<Pos2>,
    /// Buttons that went down on a widget.
    held: Vec<MouseButton>,
    is_over: bool,
}

impl Default for PanelInterface {
    fn default() -> Self {
        let context = egui::Context::default();
        context.set_theme(egui::Theme::Dark);
        // Ctrl + and - belong to nobody here; the scale is that of the screen.
        context.options_mut(|options| options.zoom_with_keyboard = false);
        context.style_mut_of(egui::Theme::Dark, style);
        Self {
            context,
            input: RawInput::default(),
            size: (1, 1),
            scale: 1.0,
            cursor: None,
            held: Vec::new(),
            is_over: false,
        }
    }
}

/// Readable on any picture, and without animations: nothing is drawn while nothing happens.
fn style(style: &mut egui::Style) {
    style.animation_time = 0.0;
    style.scroll_animation = egui::style::ScrollAnimation::none();
    style.interaction.selectable_labels = false;
    style.interaction.tooltip_delay = 0.4;
    style.interaction.tooltip_grace_time = 0.0;
    style.spacing.slider_width = 120.0;
    style.spacing.item_spacing = vec2(6.0, 4.0);
    style.visuals.panel_fill = egui::Color32::from_rgb(18, 20, 24);
    style.visuals.window_fill = egui::Color32::from_rgb(24, 27, 32);
    style.visuals.override_text_color = Some(egui::Color32::from_gray(225));
    style.visuals.popup_shadow = egui::Shadow::NONE;
    style.visuals.window_shadow = egui::Shadow::NONE;
}

/// Whether the panel needs another pass after an event, and whether the event goes no further.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TakenEvent {
    /// Something in the panel may look different now.
    pub changes: bool,
    /// The event was for the panel alone.
    pub consumed: bool,
}

impl PanelInterface {
    /// Hands an event over. With `is_shown` false nothing is taken but the size.
    pub fn event(&mut self, event: &ViewerEvent, is_shown: bool) -> TakenEvent {
        if let ViewerEvent::Size {
            width,
            height,
            scale,
        } = *event
        {
            self.size = (width, height);
            self.scale = if scale.is_finite() {
                scale.clamp(0.25, 8.0)
            } else {
                1.0
            };
            return TakenEvent {
                changes: is_shown,
                consumed: false,
            };
        }
        if !is_shown {
            self.held.clear();
            self.is_over = false;
            if let ViewerEvent::Cursor(at) = event {
                self.cursor = Some(self.point(*at));
            }
            return TakenEvent {
                changes: false,
                consumed: false,
            };
        }
        let (changes, consumed) = self.take(event);
        TakenEvent { changes, consumed }
    }

    fn point(&self, [x, y]: [f64; 2]) -> Pos2 {
        pos2(x as f32 / self.scale, y as f32 / self.scale)
    }

    /// Tells whether something of the panel lies at a point.
    fn covers(&self, at: Pos2) -> bool {
        self.context
            .layer_id_at(at)
            .is_some_and(|layer| layer.order != Order::Background)
    }

    fn take(&mut self, event: &ViewerEvent) -> (bool, bool) {
        use egui::Event as E;
        match event {
            ViewerEvent::Cursor(at) => {
                let at = self.point(*at);
                self.cursor = Some(at);
                self.input.events.push(E::PointerMoved(at));
                let was_over = self.is_over;
                self.is_over = self.covers(at);
                let has_hold = !self.held.is_empty();
                (was_over || self.is_over || has_hold, has_hold)
            }
            ViewerEvent::CursorGone => {
                self.input.events.push(E::PointerGone);
                self.cursor = None;
                (std::mem::take(&mut self.is_over), false)
            }
            ViewerEvent::Button {
                button,
                pressed,
                modifiers,
            } => {
                let Some(at) = self.cursor else {
                    return (false, false);
                };
                let is_ours = if *pressed {
                    self.covers(at)
                } else {
                    self.held.contains(button)
                };
                self.held.retain(|held| held != button);
                if is_ours && *pressed {
                    self.held.push(*button);
                }
                // A press elsewhere closes what is open and takes the keyboard away.
                self.input.events.push(E::PointerButton {
                    pos: at,
                    button: match button {
                        MouseButton::Left => egui::PointerButton::Primary,
                        MouseButton::Right => egui::PointerButton::Secondary,
                        MouseButton::Middle => egui::PointerButton::Middle,
                    },
                    pressed: *pressed,
                    modifiers: flags(*modifiers),
                });
                let open = egui::Popup::is_any_open(&self.context) || self.wants_keyboard();
                (is_ours || open, is_ours)
            }
            ViewerEvent::Scroll([x, y]) => {
                let is_over = self.cursor.is_some_and(|at| self.covers(at));
                if is_over {
                    self.input.events.push(E::MouseWheel {
                        unit: egui::MouseWheelUnit::Line,
                        delta: vec2(*x as f32, *y as f32),
                        phase: egui::TouchPhase::Move,
                        modifiers: egui::Modifiers::NONE,
                    });
                }
                (is_over, is_over)
            }
            ViewerEvent::Text(c) if self.wants_keyboard() => {
                self.input.events.push(E::Text(c.to_string()));
                (true, true)
            }
            ViewerEvent::Paste(text) if self.wants_keyboard() => {
                self.input.events.push(E::Paste(text.clone()));
                (true, true)
            }
            ViewerEvent::Key {
                key,
                pressed,
                repeat,
                modifiers,
            } if self.wants_keyboard() => {
                match (*key, modifiers.control && *pressed) {
                    (KeyboardKey::Char('c'), true) => self.input.events.push(E::Copy),
                    (KeyboardKey::Char('x'), true) => self.input.events.push(E::Cut),
                    // The window answers with the text.
                    (KeyboardKey::Char('v'), true) => return (false, false),
                    _ => {}
                }
                if let Some(key) = key_of(*key) {
                    self.input.events.push(E::Key {
                        key,
                        physical_key: None,
                        pressed: *pressed,
                        repeat: *repeat,
                        modifiers: flags(*modifiers),
                    });
                }
                // What no text field uses still works.
                let is_ours = !matches!(key, KeyboardKey::Tab | KeyboardKey::F(_));
                (is_ours, is_ours)
            }
            ViewerEvent::Focus(focused) => {
                self.input.events.push(E::WindowFocused(*focused));
                self.held.clear();
                (true, false)
            }
            _ => (false, false),
        }
    }

    /// Tells whether a text field has the keyboard.
    pub fn wants_keyboard(&self) -> bool {
        self.context.text_edit_focused()
    }

    /// Width and height of the window, points.
    pub fn size_in_points(&self) -> egui::Vec2 {
        vec2(self.size.0 as f32, self.size.1 as f32) / self.scale
    }

    /// Pixels of so many points, rounded.
    pub fn pixels(&self, points: f32) -> u32 {
        (points * self.scale).round() as u32
    }

    /// Lays out and paints what `content` shows, at `time` seconds.
    pub fn run(&mut self, time: f64, content: impl FnMut(&mut Ui)) -> PaintedOverlay {
        let mut input = std::mem::take(&mut self.input);
        input.time = Some(time);
        input.screen_rect = Some(Rect::from_min_size(Pos2::ZERO, self.size_in_points()));
        input
            .viewports
            .entry(egui::ViewportId::ROOT)
            .or_default()
            .native_pixels_per_point = Some(self.scale);
        let mut output = self.context.run_ui(input, content);
        let copied = output
            .platform_output
            .commands
            .iter()
            .find_map(|command| match command {
                egui::OutputCommand::CopyText(text) => Some(text.clone()),
                _ => None,
            });
        let again_in = output
            .viewport_output
            .values()
            .map(|viewport| viewport.repaint_delay.as_secs_f64())
            .min_by(f64::total_cmp)
            .filter(|delay| *delay < 3600.0);
        let pixels_per_point = output.pixels_per_point;
        let shapes = std::mem::take(&mut output.shapes);
        PaintedOverlay {
            primitives: self.context.tessellate(shapes, pixels_per_point),
            textures: std::mem::take(&mut output.textures_delta),
            pixels_per_point,
            again_in,
            copied,
        }
    }
}

fn flags(modifiers: KeyModifiers) -> egui::Modifiers {
    egui::Modifiers {
        alt: modifiers.other,
        ctrl: modifiers.control,
        shift: modifiers.shift,
        mac_cmd: false,
        command: modifiers.control,
    }
}

/// The keys that text fields know.
fn key_of(key: KeyboardKey) -> Option<egui::Key> {
    use egui::Key as K;
    Some(match key {
        KeyboardKey::Enter => K::Enter,
        KeyboardKey::Escape => K::Escape,
        KeyboardKey::Backspace => K::Backspace,
        KeyboardKey::Delete => K::Delete,
        KeyboardKey::Home => K::Home,
        KeyboardKey::End => K::End,
        KeyboardKey::PageUp => K::PageUp,
        KeyboardKey::PageDown => K::PageDown,
        KeyboardKey::Left => K::ArrowLeft,
        KeyboardKey::Right => K::ArrowRight,
        KeyboardKey::Up => K::ArrowUp,
        KeyboardKey::Down => K::ArrowDown,
        KeyboardKey::Char('a') => K::A,
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn show(ui: &mut PanelInterface, pressed: &mut bool) -> PaintedOverlay {
        let mut painted = ui.run(0.0, |ui| {
            egui::Area::new("box".into())
                .fixed_pos(pos2(10.0, 10.0))
                .show(ui.ctx(), |ui| {
                    *pressed |= ui
                        .add_sized([100.0, 40.0], egui::Button::new("press"))
                        .clicked();
                });
        });
        // There is no device that they could go to.
        painted.textures.clear();
        painted
    }

    fn button(pressed: bool) -> ViewerEvent {
        ViewerEvent::Button {
            button: MouseButton::Left,
            pressed,
            modifiers: KeyModifiers::default(),
        }
    }

    #[test]
    fn clicks_on_the_panel_are_its_own_and_others_go_on() {
        let mut ui = PanelInterface::default();
        let mut pressed = false;
        ui.event(
            &ViewerEvent::Size {
                width: 800,
                height: 600,
                scale: 2.0,
            },
            true,
        );
        // Sizes are known from the second pass on.
        show(&mut ui, &mut pressed);
        assert!(!show(&mut ui, &mut pressed).primitives.is_empty());
        let mut event = |event: ViewerEvent, pressed: &mut bool| {
            let taken = ui.event(&event, true);
            show(&mut ui, pressed);
            taken
        };
        let outside = event(ViewerEvent::Cursor([500.0, 500.0]), &mut pressed);
        assert!(!outside.changes && !outside.consumed);
        assert!(!event(button(true), &mut pressed).consumed);
        assert!(!event(button(false), &mut pressed).consumed);
        // 60 points from the left at scale 2.
        assert!(event(ViewerEvent::Cursor([120.0, 60.0]), &mut pressed).changes);
        assert!(event(button(true), &mut pressed).consumed && !pressed);
        let dragged = event(ViewerEvent::Cursor([130.0, 64.0]), &mut pressed);
        assert!(dragged.consumed, "a drag that began on the panel");
        assert!(event(button(false), &mut pressed).consumed && pressed);
        assert!(event(ViewerEvent::Scroll([0.0, 1.0]), &mut pressed).consumed);
        let key = ViewerEvent::Key {
            key: KeyboardKey::Char('a'),
            pressed: true,
            repeat: false,
            modifiers: KeyModifiers::default(),
        };
        assert!(!event(key, &mut pressed).consumed, "no text field is open");
        // Hidden, it takes nothing.
        assert!(!ui.event(&button(true), false).consumed);
    }

    #[test]
    fn nothing_is_animated() {
        let mut ui = PanelInterface::default();
        let mut pressed = false;
        for _ in 0..5 {
            show(&mut ui, &mut pressed);
        }
        assert_eq!(show(&mut ui, &mut pressed).again_in, None);
    }
}
