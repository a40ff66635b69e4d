//! Every control of the panel, found as a screen reader finds it: it has a tooltip that names a key, and that key is one.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

use super::*;
use crate::viewer::event::{Key, Modifiers};
use crate::viewer::input::{KEYS, command};
use crate::viewer::store::Look;
use egui::accesskit::{Role, Toggled};
use egui::{Event, PointerButton, Pos2, RawInput, Rect, Shape, vec2};

/// A control on the screen.
#[derive(Debug, Clone)]
struct Seen {
    role: Role,
    name: String,
    middle: Pos2,
    is_disabled: bool,
    is_on: bool,
}

/// A panel on a screen that is high enough for all of it.
struct Stage {
    context: egui::Context,
    time: f64,
}

fn texts_of(shape: &Shape, out: &mut Vec<String>) {
    match shape {
        Shape::Text(text) => out.push(text.galley.text().to_owned()),
        Shape::Vec(shapes) => shapes.iter().for_each(|shape| texts_of(shape, out)),
        _ => {}
    }
}

impl Stage {
    fn new() -> Self {
        let context = egui::Context::default();
        context.enable_accesskit();
        context.all_styles_mut(|style| {
            style.interaction.tooltip_delay = 0.0;
            style.interaction.show_tooltips_only_when_still = false;
            style.animation_time = 0.0;
        });
        Self { context, time: 0.0 }
    }

    /// One pass: the controls, all texts, and what was asked for.
    fn pass(
        &mut self,
        state: &State<'_>,
        events: Vec<Event>,
    ) -> (Vec<Seen>, Vec<String>, Vec<Wish>) {
        self.time += 0.1;
        let size = vec2(900.0, 2000.0);
        let input = RawInput {
            screen_rect: Some(Rect::from_min_size(Pos2::ZERO, size)),
            time: Some(self.time),
            events,
            ..RawInput::default()
        };
        let mut wishes = Vec::new();
        let mut output = self.context.run_ui(input, |ui| {
            wishes.extend(show(ui.ctx(), state, size.y));
        });
        // There is no device that they could go to.
        output.textures_delta.clear();
        let mut texts = Vec::new();
        for shape in &output.shapes {
            texts_of(&shape.shape, &mut texts);
        }
        let nodes = output.platform_output.accesskit_update.unwrap().nodes;
        let seen = nodes.iter().filter_map(|(_, node)| {
            let is_control = matches!(
                node.role(),
                Role::Button
                    | Role::CheckBox
                    | Role::RadioButton
                    | Role::ComboBox
                    | Role::Slider
                    | Role::SpinButton
                    | Role::ColorWell
                    | Role::TextInput
            );
            let bounds = node.bounds().filter(|_| is_control)?;
            let middle = |a: f64, b: f64| (0.5 * (a + b)) as f32;
            Some(Seen {
                role: node.role(),
                name: node.label().or(node.value()).unwrap_or_default().to_owned(),
                middle: pos2(middle(bounds.x0, bounds.x1), middle(bounds.y0, bounds.y1)),
                is_disabled: node.is_disabled(),
                is_on: node.toggled() == Some(Toggled::True),
            })
        });
        (seen.collect(), texts, wishes)
    }

    /// The controls of a panel that has come to rest.
    fn controls(&mut self, state: &State<'_>) -> Vec<Seen> {
        for _ in 0..3 {
            self.pass(state, vec![Event::PointerGone]);
        }
        self.pass(state, Vec::new()).0
    }

    /// What appears while the cursor is over a place.
    fn tooltip(&mut self, state: &State<'_>, at: Pos2) -> Vec<String> {
        let (_, mut without, _) = self.pass(state, vec![Event::PointerGone]);
        for _ in 0..4 {
            self.pass(state, vec![Event::PointerMoved(at)]);
        }
        let (_, with, _) = self.pass(state, vec![Event::PointerMoved(at)]);
        let mut new = Vec::new();
        for text in with {
            match without.iter().position(|old| *old == text) {
                Some(index) => drop(without.swap_remove(index)),
                None => new.push(text),
            }
        }
        new
    }

    fn click(&mut self, state: &State<'_>, at: Pos2) -> Vec<Wish> {
        let button = |pressed| Event::PointerButton {
            pos: at,
            button: PointerButton::Primary,
            pressed,
            modifiers: egui::Modifiers::NONE,
        };
        self.pass(state, vec![Event::PointerMoved(at)]);
        self.pass(state, vec![button(true)]);
        self.pass(state, vec![button(false)]).2
    }
}

fn facts() -> Facts {
    Facts {
        name: "model".into(),
        triangles: 12,
        ..Facts::default()
    }
}

/// Settings under which every control is used at least once.
fn all_settings() -> Vec<Settings> {
    let mut all = Vec::new();
    for (method, ..) in choices::METHODS {
        for (splat, ..) in choices::SPLATS {
            all.push(Settings {
                method: *method,
                splat: *splat,
                depth_offset: Some(2.0),
                ..Settings::default()
            });
        }
    }
    all
}

fn state<'a>(settings: &'a Settings, facts: &'a Facts) -> State<'a> {
    State {
        settings,
        light: Light::Point,
        facts: Some(facts),
        status: None,
        frame_ms: 1.0,
        counts: Counts::default(),
        control: None,
        is_flying: false,
    }
}

/// The words of the list of keys.
fn listed_keys() -> Vec<&'static str> {
    let keys = KEYS[1..].iter().flat_map(|(_, keys)| keys.iter());
    keys.flat_map(|(key, _)| key.split([' ']))
        .map(|word| {
            word.strip_suffix(',')
                .filter(|w| !w.is_empty())
                .unwrap_or(word)
        })
        .collect()
}

/// Whether a tooltip names, in parentheses, a key that is listed.
fn names_a_key(tip: &str) -> bool {
    let listed = listed_keys();
    tip.split('(').skip(1).any(|part| {
        let inside = part.split(')').next().unwrap_or_default();
        let mut words = inside.split([' ', ':']).flat_map(|word| {
            let bare = word.strip_suffix(',').filter(|w| !w.is_empty());
            [Some(word), bare].into_iter().flatten()
        });
        words.any(|word| listed.contains(&word))
    })
}

/// The commands of all keys.
fn commands() -> Vec<Command> {
    let letters = ('!'..='~').map(Key::Char);
    let others = [
        Key::Tab,
        Key::Space,
        Key::Enter,
        Key::Backspace,
        Key::Escape,
        Key::F(1),
        Key::F(11),
    ];
    let digits = (1..=9).map(Key::Digit);
    let keys: Vec<Key> = letters.chain(others).chain(digits).collect();
    let mut all = Vec::new();
    for shift in [false, true] {
        for control in [false, true] {
            let modifiers = Modifiers {
                shift,
                control,
                other: false,
            };
            all.extend(keys.iter().filter_map(|key| command(*key, modifiers)));
        }
    }
    all
}

#[test]
fn every_control_has_a_tooltip_with_its_key() {
    let facts = facts();
    let mut names = Vec::new();
    for settings in all_settings() {
        let state = state(&settings, &facts);
        let mut stage = Stage::new();
        for control in stage.controls(&state) {
            let tip = stage.tooltip(&state, control.middle);
            assert!(
                tip.iter().any(|text| names_a_key(text)),
                "{control:?} has the tooltip {tip:?}, with {settings:?}"
            );
            if !names.contains(&control.name) && !control.is_disabled {
                names.push(control.name);
            }
        }
    }
    // What this finds, so that it does not find nothing.
    for name in [
        "pop",
        "square",
        "usual",
        "exact",
        "auto",
        "shading",
        "light both sides",
        "hold the cut",
        "Picture",
    ] {
        assert!(names.iter().any(|n| n == name), "no {name} among {names:?}");
    }
    assert!(names.len() > 25, "{names:?}");
    assert!(!names_a_key("Nothing") && !names_a_key("Light (no key)") && names_a_key("Light (L)"));
}

#[test]
fn what_a_click_does_a_key_does() {
    let facts = facts();
    let commands = commands();
    let settings = Settings {
        method: Method::Splats,
        depth_offset: Some(2.0),
        splat: SplatKind::Gauss,
        ..Settings::default()
    };
    let state = state(&settings, &facts);
    let mut stage = Stage::new();
    let mut done = 0;
    for control in stage.controls(&state) {
        if control.is_disabled || !matches!(control.role, Role::Button | Role::CheckBox) {
            continue;
        }
        // What opens a list or a window of its own asks for nothing yet; a chosen method is chosen.
        let opens = control.role == Role::Button && control.name.is_empty();
        let wishes = stage.click(&state, control.middle);
        let is_chosen = control.is_on && control.role == Role::Button;
        assert!(
            wishes.len() == 1 || (opens || is_chosen) && wishes.is_empty(),
            "{control:?} asks for {wishes:?}"
        );
        for wish in wishes {
            done += 1;
            let is_a_keys = match &wish {
                Wish::Command(command) => commands.contains(command),
                Wish::Settings(new) if new.method != settings.method => {
                    commands.contains(&Command::Method(new.method))
                }
                Wish::Settings(new) if new.two_sided != settings.two_sided => {
                    commands.contains(&Command::TwoSided)
                }
                Wish::Settings(new) if new.use_colors != settings.use_colors => {
                    commands.contains(&Command::Colors)
                }
                Wish::Settings(new) => {
                    new.depth_offset.is_none() && commands.contains(&Command::UsualDepthOffset)
                }
                Wish::Light(_) => commands.contains(&Command::Light),
            };
            assert!(
                is_a_keys,
                "{control:?} asks for {wish:?}, which no key does"
            );
            // What was changed is kept.
            if let Wish::Settings(new) = wish {
                assert_eq!(Look::of(&new).settings(), Ok(*new));
            }
        }
    }
    assert!(done >= 16, "{done}");
}

#[test]
fn every_choice_of_the_panel_is_kept() {
    let usual = Settings::default();
    let mut kept = 0;
    let mut keep = |settings: Settings| {
        assert_eq!(Look::of(&settings).settings(), Ok(settings));
        kept += usize::from(settings != usual);
    };
    for &(method, ..) in choices::METHODS {
        keep(Settings { method, ..usual });
    }
    for &(splat, ..) in choices::SPLATS {
        keep(Settings { splat, ..usual });
    }
    for &(blend, ..) in choices::BLENDS {
        keep(Settings { blend, ..usual });
    }
    for &(shading, ..) in choices::SHADINGS {
        keep(Settings { shading, ..usual });
    }
    for &(reconstruction, ..) in choices::RECONSTRUCTIONS {
        keep(Settings {
            reconstruction,
            ..usual
        });
    }
    for &(size, ..) in choices::METRICS {
        keep(Settings { size, ..usual });
    }
    for &(culling, ..) in choices::CULLINGS {
        keep(Settings { culling, ..usual });
    }
    for &(color_by, ..) in choices::COLORS_BY {
        keep(Settings { color_by, ..usual });
    }
    for &(background, ..) in choices::BACKGROUNDS {
        keep(Settings {
            background,
            ..usual
        });
    }
    assert_eq!(kept, 3 + 5 + 4 + 1 + 2 + 4 + 2 + 5 + 2);
}
