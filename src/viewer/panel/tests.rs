//! Every control of the panel, found as a screen reader finds it: it has a tooltip that names a key, and that key is one.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

mod keep_field;
mod recent;
use super::*;
use crate::image::MarkChoice;
use crate::math::camera::HeadlightSource;
use crate::oriented::splats::SplatRules;
use crate::pack::lit_sphere::LitSphere;
use crate::pack::{Lamp, Phong};
use crate::render::stats::{FrameCounts, OverdrawSummary};
use crate::viewer::event::{KeyModifiers, KeyboardKey};
use crate::viewer::input::{KEYS, command};
use crate::viewer::store::StoredLook;
use egui::accesskit::{Role, Toggled};
use egui::{Event, PointerButton, Pos2, RawInput, Rect, Shape, vec2};

/// A control on the screen.
#[derive(Debug, Clone)]
struct Seen {
    id: egui::accesskit::NodeId,
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
        state: &PanelState<'_>,
        events: Vec<Event>,
    ) -> (Vec<Seen>, Vec<String>, Vec<PanelWish>) {
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
        let seen = nodes.iter().filter_map(|(id, node)| {
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
                id: *id,
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
    fn controls(&mut self, state: &PanelState<'_>) -> Vec<Seen> {
        for _ in 0..3 {
            self.pass(state, vec![Event::PointerGone]);
        }
        self.pass(state, Vec::new()).0
    }

    /// What appears while the cursor is over a place.
    fn tooltip(&mut self, state: &PanelState<'_>, at: Pos2) -> Vec<String> {
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

    fn click(&mut self, state: &PanelState<'_>, at: Pos2) -> Vec<PanelWish> {
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

fn facts() -> PanelFacts {
    PanelFacts {
        name: "model".into(),
        triangles: 12,
        ..PanelFacts::default()
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
    all.push(Settings {
        method: Method::Splats,
        vertex_splats: Some(SplatRules {
            angle_test: Some(0.2),
            ..SplatRules::usual()
        }),
        ..Settings::default()
    });
    for lamp in lamps() {
        all.push(Settings {
            light: SurfaceLighting::Phong(lamp),
            ..Settings::default()
        });
    }
    all
}

/// A lamp of each kind.
fn lamps() -> [Phong; 2] {
    let usual = Phong::default();
    let in_world = Phong {
        lamp: Lamp::At(glam::DVec3::new(1.0, -2.5, 3.0)),
        ..usual
    };
    [usual, in_world]
}

fn state<'a>(settings: &'a Settings, facts: &'a PanelFacts) -> PanelState<'a> {
    PanelState {
        settings,
        light: LightKind::of(HeadlightSource::Point, &settings.light),
        normals: SurfaceNormals::File,
        recent: &[],
        radius: 2.0,
        facts: Some(facts),
        status: None,
        frame_ms: 1.0,
        counts: FrameCounts::default(),
        overdraw: None,
        control: None,
        marks: MarkChoice::default(),
        is_flying: false,
        parts: Vec::new(),
        photographs: None,
        measures: MeasureState::default(),
        keep: Some(keep::for_tests()),
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

/// Beginnings of the tooltips of controls that no key has.
const WITHOUT_KEYS: [&str; 6] = [
    "Draw a node as one polygon",
    "Error of",
    "End of the section",
    "Hold the shade",
    "Of vertices: ",
    "Values of points",
];

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
fn commands() -> Vec<KeyCommand> {
    let letters = ('!'..='~').map(KeyboardKey::Char);
    let others = [
        KeyboardKey::Left,
        KeyboardKey::PageUp,
        KeyboardKey::Home,
        KeyboardKey::End,
        KeyboardKey::Tab,
        KeyboardKey::Space,
        KeyboardKey::Enter,
        KeyboardKey::Backspace,
        KeyboardKey::Escape,
        KeyboardKey::F(1),
        KeyboardKey::F(11),
    ];
    let digits = (1..=9).map(KeyboardKey::Digit);
    let keys: Vec<KeyboardKey> = letters.chain(others).chain(digits).collect();
    let mut all = Vec::new();
    for shift in [false, true] {
        for control in [false, true] {
            let modifiers = KeyModifiers {
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
            // Patches are set once for a model, in the panel or by --error.
            let has_none = |text: &String| WITHOUT_KEYS.iter().any(|own| text.starts_with(own));
            assert!(
                tip.iter().any(|text| names_a_key(text) || has_none(text)),
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
        "splats from vertices",
        "angle test",
        "levels, triangles",
        "Poisson disc",
        "Picture",
        "none",
        "goes with the viewer",
        "stays in the world",
        "-30.0°",
        "30.0°",
        "-2.500",
        "0.10",
        "0.20",
        "32.0",
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
                PanelWish::Command(command) => commands.contains(command),
                PanelWish::Settings(new) if new.method != settings.method => {
                    commands.contains(&KeyCommand::Method(new.method))
                }
                PanelWish::Settings(new) if new.vertex_splats != settings.vertex_splats => {
                    commands.contains(&KeyCommand::VertexSplats)
                }
                PanelWish::Settings(new) if new.two_sided != settings.two_sided => {
                    commands.contains(&KeyCommand::TwoSided)
                }
                PanelWish::Settings(new) if new.use_colors != settings.use_colors => {
                    commands.contains(&KeyCommand::Colors)
                }
                PanelWish::Settings(new) => {
                    new.depth_offset.is_none() && commands.contains(&KeyCommand::UsualDepthOffset)
                }
                PanelWish::Keep(_) => commands.contains(&KeyCommand::Keep),
                PanelWish::ColorPoints(_) => commands.contains(&KeyCommand::PointColors),
                PanelWish::Light(_) => commands.contains(&KeyCommand::Light),
                PanelWish::Normals(_) => commands.contains(&KeyCommand::Normals),
                PanelWish::Show { .. } | PanelWish::Photograph(_) => false,
                PanelWish::RemoveMeasure(_) | PanelWish::Open(_) => false,
                PanelWish::FrameTime(_) => commands.contains(&KeyCommand::FrameTime(1)),
            };
            assert!(
                is_a_keys,
                "{control:?} asks for {wish:?}, which no key does"
            );
            if let PanelWish::Settings(new) = wish {
                assert_eq!(StoredLook::of(&new).settings(), Ok(*new));
            }
        }
    }
    assert!(done >= 16, "{done}");
}

/// The one control of a name and role.
fn find<'s>(controls: &'s [Seen], role: Role, name: &str) -> &'s Seen {
    let found: Vec<&Seen> = controls
        .iter()
        .filter(|c| c.role == role && c.name == name)
        .collect();
    assert_eq!(found.len(), 1, "{name} {role:?} among {controls:?}");
    found[0]
}

#[test]
fn the_lamp_is_turned_on_moved_and_put_into_the_world() {
    let facts = facts();
    let mut settings = Settings::default();
    let mut stage = Stage::new();
    // Opens a list and clicks what it offers.
    fn pick(stage: &mut Stage, state: &PanelState<'_>, list: &str, choice: &str) -> Vec<PanelWish> {
        let controls = stage.controls(state);
        let at = find(&controls, Role::ComboBox, list).middle;
        stage.click(state, at);
        let (controls, ..) = stage.pass(state, Vec::new());
        let at = find(&controls, Role::Button, choice).middle;
        stage.click(state, at)
    }
    let wishes = pick(&mut stage, &state(&settings, &facts), "in the eye", "lamp");
    assert_eq!(wishes, [PanelWish::Light(LightKind::Lamp)]);
    settings.light = SurfaceLighting::Phong(Phong::default());
    let with_lamp = state(&settings, &facts);
    // What a screen reader writes into a field.
    let mut write = |field: usize, value: f64| {
        let names = ["-30.0°", "30.0°", "0.10", "0.20", "32.0"];
        let controls = stage.controls(&with_lamp);
        let id = find(&controls, Role::SpinButton, names[field]).id;
        let request = egui::accesskit::ActionRequest {
            action: egui::accesskit::Action::SetValue,
            target_tree: egui::accesskit::TreeId::ROOT,
            target_node: id,
            data: Some(egui::accesskit::ActionData::NumericValue(value)),
        };
        let (.., wishes) = stage.pass(&with_lamp, vec![Event::AccessKitActionRequest(request)]);
        let [PanelWish::Settings(new)] = wishes.as_slice() else {
            panic!("{} asks for {wishes:?}", names[field])
        };
        let SurfaceLighting::Phong(phong) = new.light else {
            panic!("the lamp is off: {new:?}")
        };
        assert_eq!(StoredLook::of(new).settings(), Ok(**new), "it is kept");
        phong
    };
    let usual = Phong::default();
    let from = |azimuth, elevation| Phong {
        lamp: crate::viewer::lamp::from_camera(azimuth, elevation),
        ..usual
    };
    assert_eq!(write(0, 75.0), from(75.0, 30.0));
    assert_eq!(write(1, -12.5), from(-30.0, -12.5));
    assert_eq!(write(1, 400.0), from(-30.0, 90.0), "no farther than above");
    assert_eq!(write(2, 0.5).ambient, 0.5);
    assert_eq!(write(3, 1.0).specular, 1.0);
    assert_eq!(write(4, 100.0).shininess, 100.0);
    assert_eq!(write(4, 0.0).shininess, 1.0, "no smaller");
    let anchor = [PanelWish::Command(KeyCommand::Lamp(
        crate::viewer::lamp::LampChange::Anchor,
    ))];
    let (with, stays) = ("goes with the viewer", "stays in the world");
    assert_eq!(pick(&mut stage, &with_lamp, with, stays), anchor);
    let in_world = lamps()[1];
    settings.light = SurfaceLighting::Phong(in_world);
    let state = state(&settings, &facts);
    assert_eq!(pick(&mut stage, &state, stays, with), anchor);
    let controls = stage.controls(&state);
    for name in ["1.000", "-2.500", "3.000"] {
        find(&controls, Role::SpinButton, name);
    }
}

#[test]
fn the_time_of_frames_is_chosen() {
    let (facts, settings) = (facts(), Settings::default());
    let mut stage = Stage::new();
    for (now, shown, choice, wish) in [
        (None, "none", "33 ms", Some(33.0)),
        (Some(33.0), "33 ms", "none", None),
        (Some(21.5), "21.5 ms", "16 ms", Some(16.0)),
    ] {
        let state = PanelState {
            control: now.map(|ms| (1.0, ms, BudgetReport::Adapting)),
            ..state(&settings, &facts)
        };
        let controls = stage.controls(&state);
        let at = find(&controls, Role::ComboBox, shown).middle;
        stage.click(&state, at);
        let (controls, ..) = stage.pass(&state, Vec::new());
        let at = find(&controls, Role::Button, choice).middle;
        assert_eq!(stage.click(&state, at), [PanelWish::FrameTime(wish)]);
    }
}

#[test]
fn every_choice_of_the_panel_is_kept() {
    let usual = Settings::default();
    let mut kept = 0;
    let mut keep = |settings: Settings| {
        assert_eq!(StoredLook::of(&settings).settings(), Ok(settings));
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
    for &(eye_dome, ..) in choices::EYE_DOMES {
        keep(Settings { eye_dome, ..usual });
    }
    for &(ambient_occlusion, ..) in choices::AMBIENT_OCCLUSIONS {
        keep(Settings {
            ambient_occlusion,
            ..usual
        });
    }
    for &(color_by, ..) in choices::COLORS_BY {
        keep(Settings { color_by, ..usual });
    }
    for &((background, background_bottom), ..) in choices::BACKGROUNDS {
        keep(Settings {
            background,
            background_bottom,
            ..usual
        });
    }
    for lamp in lamps() {
        let light = SurfaceLighting::Phong(lamp);
        keep(Settings { light, ..usual });
    }
    for sphere in LitSphere::ALL {
        let light = SurfaceLighting::Sphere(sphere);
        keep(Settings { light, ..usual });
    }
    assert_eq!(kept, 4 + 1 + 2 + 3 + 5 + 4 + 1 + 2 + 4 + 2 + 2 + 2 + 6 + 2);
}

#[test]
fn the_colors_of_overdraw_have_a_legend() {
    let mut stage = Stage::new();
    let facts = PanelFacts::default();
    let mut texts = |color_by: ColorBy, found: Option<OverdrawSummary>| {
        let settings = Settings {
            color_by,
            ..Settings::default()
        };
        let state = PanelState {
            overdraw: found,
            ..state(&settings, &facts)
        };
        stage.controls(&state);
        stage.pass(&state, Vec::new()).1
    };
    let found = OverdrawSummary::of([0, 1, 2, 1500]);
    let shown = texts(ColorBy::Overdraw, Some(found));
    for text in [" 1 ", " 8 ", " 64+ ", "mean 501.00 a pixel, most 1,500"] {
        assert!(shown.iter().any(|t| t == text), "{text}: {shown:?}");
    }
    // Before the first frame that counted there are no figures yet.
    let shown = texts(ColorBy::Overdraw, None);
    assert!(shown.iter().any(|t| t == " 8 ") && !shown.iter().any(|t| t.contains("mean")));
    let shown = texts(ColorBy::Depth, None);
    assert!(!shown.iter().any(|t| t == " 8 "));
}

#[test]
fn a_window_lower_than_the_margins_of_the_panel_has_one() {
    let settings = Settings::default();
    let facts = facts();
    let context = egui::Context::default();
    for height in [1.0, 8.0, 20.0, 21.0] {
        let input = RawInput {
            screen_rect: Some(Rect::from_min_size(Pos2::ZERO, vec2(300.0, height))),
            ..RawInput::default()
        };
        let mut output = context.run_ui(input, |ui| {
            show(ui.ctx(), &state(&settings, &facts), height);
        });
        output.textures_delta.clear();
    }
}
