//! What the window says in words: its title, and the statistics.

use crate::gpu::frame::PassTime;
use crate::math::camera::HeadlightSource;
use crate::render::stats::FrameCounts;
use crate::render::stats::FrameTimes;
use crate::render::vulkan::overdraw;
use crate::render::{Method, Settings};
use crate::tree::Model;
use crate::viewer::{choices, lamp};
use std::fmt::Write as _;
use std::path::Path;

/// Makes a sentence about a model that could not be opened; most errors name their file.
pub fn unopened(path: &Path, message: &str) -> String {
    let name = path.display().to_string();
    match message.contains(&name) {
        true => message.to_owned(),
        false => format!("{name}: {message}"),
    }
}

/// Short name of what is opened.
pub fn name(path: &Path) -> String {
    match path.file_name() {
        _ if path == Path::new("-") => "standard input".into(),
        Some(name) => name.to_string_lossy().into_owned(),
        None => path.display().to_string(),
    }
}

/// A count with its thousands apart.
pub fn count(value: u64) -> String {
    let digits = value.to_string();
    let mut out = String::with_capacity(digits.len() * 4 / 3);
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            out.push(',');
        }
        out.push(digit);
    }
    out
}

/// Name of a method.
pub fn method(method: Method) -> &'static str {
    match method {
        Method::Triangles => "triangles",
        Method::Points => "points",
        Method::Splats => "splats",
        Method::Pop => "pop",
    }
}

fn counts(counts: &FrameCounts) -> String {
    let parts: Vec<String> = [
        (counts.splats, "splats"),
        (counts.triangles, "triangles"),
        (counts.points, "points"),
    ]
    .into_iter()
    .filter(|(value, _)| *value > 0)
    .map(|(value, what)| format!("{} {what}", count(value)))
    .collect();
    if parts.is_empty() {
        "nothing in view".into()
    } else {
        parts.join(", ")
    }
}

/// The title while a model is shown; with `frame` milliseconds and counts of the last frame.
pub fn title(name: &str, settings: &Settings, frame: Option<(f64, &FrameCounts)>) -> String {
    let Some((frame_ms, drawn)) = frame else {
        return format!("{name} - surfel");
    };
    let method = match settings.method {
        Method::Triangles => method(settings.method).to_owned(),
        other => format!("{}, threshold {} px", method(other), settings.threshold_px),
    };
    format!(
        "{name} - {method} - {frame_ms:.1} ms - {} - surfel",
        counts(drawn)
    )
}

/// The title while a model is loaded.
pub fn loading(name: &str, status: &str) -> String {
    format!("{name} - {status} - surfel")
}

/// What is said while pages of a paged file are still to come.
pub fn pages_to_come(count: usize) -> String {
    match count {
        1 => "1 finer page is on its way".to_owned(),
        _ => format!("{count} finer pages are on their way"),
    }
}

/// The title that tells of a failure: its first line.
pub fn failed(message: &str) -> String {
    format!("{} - surfel", message.lines().next().unwrap_or("failed"))
}

/// What the statistics are about, besides the frame.
#[derive(Debug)]
pub struct TitleFacts<'a> {
    /// Name of the model.
    pub name: &'a str,
    /// The model.
    pub model: &'a Model,
    /// How it is drawn.
    pub settings: &'a Settings,
    /// The headlight, where no lamp is on.
    pub headlight: HeadlightSource,
    /// Name of the device.
    pub device: &'a str,
    /// How frames reach the screen.
    pub present_mode: &'a str,
    /// Size of the picture, pixels.
    pub size: (u32, u32),
}

/// Statistics for people, as Enter prints them. `frame_ms` is the median of the last frames.
pub fn statistics(facts: &TitleFacts<'_>, frame_ms: f64, times: &FrameTimes) -> String {
    let TitleFacts {
        name,
        model,
        settings,
        ..
    } = facts;
    let on = |is_on: bool| if is_on { "on" } else { "off" };
    let c = &times.counts;
    let mut out = format!(
        "{name}: {} vertices, {} triangles, {} nodes\n",
        count(model.vertices.len() as u64),
        count(model.triangles.len() as u64),
        count((model.tree.nodes.len() + model.tree.leaves.len()) as u64),
    );
    let fps = if frame_ms > 0.0 { 1e3 / frame_ms } else { 0.0 };
    // Writing to a string cannot fail.
    let _ = writeln!(
        out,
        "  method {}, threshold {} px, culling {}, colors by {}",
        method(settings.method),
        settings.threshold_px,
        on(settings.culls_back(model.is_closed)),
        choices::name_of(choices::COLORS_BY, settings.color_by),
    );
    let _ = writeln!(
        out,
        "  light {}",
        lamp::words(facts.headlight, &settings.light)
    );
    let _ = writeln!(
        out,
        "  window {} x {} px, present mode {}, device {}",
        facts.size.0, facts.size.1, facts.present_mode, facts.device,
    );
    let _ = writeln!(out, "  frame {frame_ms:.2} ms ({fps:.1} fps)");
    let _ = writeln!(
        out,
        "  cpu: cut {:.2} ms, pack {:.2} ms, submit {:.2} ms",
        times.cut_ms, times.pack_ms, times.submit_ms,
    );
    let passes: Vec<String> = times
        .passes
        .iter()
        .map(|PassTime { name, ms }| format!("{name} {ms:.2} ms"))
        .collect();
    if !passes.is_empty() {
        let _ = writeln!(out, "  device: {}", passes.join(", "));
    }
    let _ = writeln!(
        out,
        "  drawn: {} splats, {} triangles, {} points; {} nodes visited; {} bytes of draw lists",
        count(c.splats),
        count(c.triangles),
        count(c.points),
        count(c.nodes_visited),
        count(c.draw_list_bytes),
    );
    if let Some(found) = times.overdraw {
        let _ = writeln!(out, "  {found}");
        let _ = writeln!(out, "  {}", overdraw::legend_line());
    }
    out
}

/// The median; 0 of nothing.
pub fn median(values: impl IntoIterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.into_iter().collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn titles_say_what_is_shown() {
        let mut settings = Settings {
            threshold_px: 1.25,
            ..Settings::default()
        };
        let counts = FrameCounts {
            splats: 1_234_567,
            triangles: 89,
            ..FrameCounts::default()
        };
        assert_eq!(
            title("scan.ply", &settings, Some((12.345, &counts))),
            "scan.ply - pop, threshold 1.25 px - 12.3 ms - 1,234,567 splats, 89 triangles - surfel"
        );
        assert_eq!(title("scan.ply", &settings, None), "scan.ply - surfel");
        settings.method = Method::Triangles;
        assert_eq!(
            title("x", &settings, Some((0.04, &FrameCounts::default()))),
            "x - triangles - 0.0 ms - nothing in view - surfel"
        );
        assert_eq!(
            loading("scan.ply", "building nodes 43%"),
            "scan.ply - building nodes 43% - surfel"
        );
        assert_eq!(failed("no such file\nat all"), "no such file - surfel");
    }

    #[test]
    fn names_and_counts() {
        assert_eq!(name(Path::new("a/b/scan.ply.gz")), "scan.ply.gz");
        assert_eq!(name(Path::new("-")), "standard input");
        assert_eq!(
            name(Path::new("generate:statue:2000000")),
            "generate:statue:2000000"
        );
        assert_eq!(name(Path::new("/")), "/");
        for (value, text) in [
            (0, "0"),
            (999, "999"),
            (1000, "1,000"),
            (12_345_678, "12,345,678"),
        ] {
            assert_eq!(count(value), text);
        }
        assert_eq!(median([]), 0.0);
        assert_eq!(median([3.0, 1.0, 2.0]), 2.0);
    }
}
