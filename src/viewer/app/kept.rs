//! Parts of the models that are kept while they are shown: made from trees that are there, nothing is read or ordered again.

use super::{FileAsk, ViewerApp};
use crate::input::{ColorSetting, PointColoring, PointFilter};
use crate::mesh::attributes::{AttributeColumn, AttributeValues};
use crate::mesh::color_legend::ColorLegend;
use crate::viewer::kept_models::{PartWish, WholeModel};
use crate::viewer::loader::ModelLoader;
use crate::viewer::panel::keep::{KeepState, has_class};
use crate::viewer::panel::point_colors::PointColorState;
use std::collections::BTreeSet;

/// Most classes that the panel lists.
const MOST_CLASSES: usize = 16;

/// Parts of the models that are shown, and the models themselves.
#[derive(Debug, Default)]
pub(super) struct KeptParts {
    /// Models as they were opened; none while one of them is a paged file that is read by pages.
    wholes: Vec<WholeModel>,
    /// Conditions and colors of the picture; without conditions, all is shown.
    shown: PartWish,
    /// Conditions and colors of what is being made.
    wanted: Option<PartWish>,
    /// Conditions that were taken away last.
    last: PointFilter,
    /// Classes that points have.
    classes: Vec<u8>,
    /// Quantities that colors of points can stand for.
    choices: Vec<PointColoring>,
    /// Meaning of the colors that the models were opened with.
    pub(super) opened_legend: Option<ColorLegend>,
}

impl KeptParts {
    /// Conditions and colors of what is shown, or will be.
    fn latest(&self) -> &PartWish {
        self.wanted.as_ref().unwrap_or(&self.shown)
    }
}

impl ViewerApp {
    /// Keeps what these conditions say of the models, once that is made.
    pub(super) fn keep(&mut self, text: &str) {
        match PointFilter::of_words(text) {
            Ok(filter) => self.keep_by(filter),
            Err(error) => self.warn(&format!("{text}: {error}")),
        }
    }

    fn keep_by(&mut self, filter: PointFilter) {
        let color = self.kept.latest().color.clone();
        self.want_part(PartWish { filter, color });
    }

    /// Asks for what is to be shown of the models.
    fn want_part(&mut self, wish: PartWish) {
        if self.kept.wholes.is_empty() {
            // Asked for again once they have come.
            let is_there = self.screen.model().is_some() && !self.is_preview;
            if is_there && self.reload_whole("parts and colors are made of the whole model") {
                self.kept.shown = wish;
            }
            return;
        }
        self.kept.wanted = Some(wish);
        self.asks.push(FileAsk::Keep);
    }

    /// Shows all again, or the part that was shown before.
    pub(super) fn switch_kept(&mut self) {
        if self.kept.shown.filter.is_empty() && self.kept.last.is_empty() {
            self.inform("nothing is left out; the panel has a field for what is kept");
            return;
        }
        let other = match self.kept.shown.filter.is_empty() {
            true => self.kept.last.clone(),
            false => PointFilter::default(),
        };
        self.keep_by(other);
    }

    /// Colors points by what they carry, once that is made, or as they were opened.
    pub(super) fn color_points(&mut self, color: Option<ColorSetting>) {
        let filter = self.kept.latest().filter.clone();
        self.want_part(PartWish { filter, color });
    }

    /// Colors points by the next of what they carry; after the last come the colors that they were opened with.
    pub(super) fn next_point_colors(&mut self) {
        let choices = self.color_choices();
        if choices.is_empty() {
            self.inform("nothing is carried by points that colors could stand for");
            return;
        }
        let by = (self.kept.latest().color.as_ref()).map(|setting| &setting.by);
        let at = choices.iter().position(|choice| Some(choice) == by);
        let next = choices.get(at.map_or(0, |at| at + 1)).cloned();
        match &next {
            Some(by) => self.inform(&format!("points by {by}")),
            None => self.inform("points in the colors that they were opened with"),
        }
        self.color_points(next.map(|by| ColorSetting { by, range: None }));
    }

    /// Quantities that colors of points can stand for. Points of paged files carry nothing, and have a height.
    fn color_choices(&self) -> Vec<PointColoring> {
        match self.kept.wholes.is_empty() && self.screen.is_paged() && self.screen.has_points() {
            true => vec![PointColoring::Height],
            false => self.kept.choices.clone(),
        }
    }

    /// Starts to make what was asked for.
    pub(in crate::viewer) fn start_keeping(&mut self, loader: &mut ModelLoader) {
        let Some(wanted) = self.kept.wanted.clone() else {
            return;
        };
        self.tell_device(loader);
        let wholes = self.kept.wholes.clone();
        if let Err(error) = loader.start_keeping(&self.path, wholes, wanted) {
            self.kept.wanted = None;
            self.warn(&format!("cannot start to make a part: {error}"));
        }
    }

    /// Takes note that a part is shown, or that it could not be made.
    pub(super) fn part_came(&mut self, is_shown: bool) {
        let Some(wanted) = self.kept.wanted.take().filter(|_| is_shown) else {
            if self.kept.wholes.is_empty() {
                // The whole of a paged file could not be had for it.
                self.kept.shown = PartWish::default();
            }
            return;
        };
        let before = std::mem::replace(&mut self.kept.shown, wanted).filter;
        if !before.is_empty() {
            self.kept.last = before;
        }
    }

    /// Takes models that were opened; of files that were opened again the same is kept.
    pub(super) fn take_wholes(&mut self, wholes: Vec<WholeModel>, is_same: bool) {
        let shown = std::mem::take(&mut self.kept.shown);
        let clouds = || wholes.iter().filter(|own| own.model.kind().is_points());
        let columns = clouds().filter_map(|own| own.attributes.find("class"));
        let classes: BTreeSet<u8> = columns.flat_map(classes_of).collect();
        self.kept = KeptParts {
            classes: classes.into_iter().take(MOST_CLASSES).collect(),
            choices: choices_of(clouds()),
            opened_legend: self.kept.opened_legend.take(),
            wholes,
            ..KeptParts::default()
        };
        if is_same && shown != PartWish::default() && !self.kept.wholes.is_empty() {
            self.want_part(shown);
        }
    }

    /// Gives the panel its part; none where nothing can be left out.
    pub(super) fn keep_state(&self) -> Option<KeepState> {
        let kept = &self.kept;
        let PartWish { filter, color } = kept.latest();
        let classes = kept.classes.iter();
        let is_any = !kept.wholes.is_empty() || self.screen.is_paged();
        (is_any && !self.is_preview).then(|| KeepState {
            text: filter.to_string(),
            classes: classes
                .map(|&class| (class, has_class(filter, class)))
                .collect(),
            colors: PointColorState {
                choices: self.color_choices(),
                by: color.as_ref().map(|setting| setting.by.clone()),
                opened_by: kept.opened_legend.as_ref().map(|own| own.title.clone()),
                range: self.legend.as_ref().and_then(ColorLegend::range),
            },
        })
    }
}

/// Quantities that colors of clouds can stand for: their height, and each attribute that one of them has.
fn choices_of<'a>(clouds: impl Iterator<Item = &'a WholeModel>) -> Vec<PointColoring> {
    let mut choices = Vec::new();
    for own in clouds {
        let columns = own.attributes.columns.iter();
        let names = columns.map(|column| PointColoring::Attribute(column.name.clone()));
        for choice in [PointColoring::Height].into_iter().chain(names) {
            if !choices.contains(&choice) {
                choices.push(choice);
            }
        }
    }
    choices
}

/// The classes in a column.
fn classes_of(column: &AttributeColumn) -> Vec<u8> {
    let mut is_there = [false; 256];
    let mut note = |value: f64| is_there[value.clamp(0.0, 255.0) as usize] = true;
    match &column.values {
        AttributeValues::U8(values) => values.iter().for_each(|&value| note(value.into())),
        values => {
            let count = match values {
                AttributeValues::Constant { count, .. } => (*count).min(1),
                values => values.len(),
            };
            (0..count)
                .filter_map(|at| values.get(at))
                .for_each(&mut note);
        }
    }
    (0..=255)
        .filter(|&class| is_there[usize::from(class)])
        .collect()
}
