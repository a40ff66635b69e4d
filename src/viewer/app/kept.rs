//! Parts of the models that are kept while they are shown: made from trees that are there, nothing is read or ordered again.

use super::{FileAsk, ViewerApp};
use crate::input::PointFilter;
use crate::mesh::attributes::{AttributeColumn, AttributeValues};
use crate::viewer::kept_models::WholeModel;
use crate::viewer::loader::ModelLoader;
use crate::viewer::panel::keep::{KeepState, has_class};
use std::collections::BTreeSet;

/// Most classes that the panel lists.
const MOST_CLASSES: usize = 16;

/// Conditions of what is kept, and the models that it is kept of.
#[derive(Debug, Default)]
pub(super) struct KeptParts {
    /// Models as they were opened; none of paged files, which are not in memory.
    wholes: Vec<WholeModel>,
    /// Conditions of what is shown; without any, all is.
    text: String,
    /// Conditions of what is being made.
    wanted: Option<String>,
    /// Conditions that were taken away last.
    last: String,
    /// Classes that points have.
    classes: Vec<u8>,
}

impl ViewerApp {
    /// Keeps what these conditions say of the models, once that is made.
    pub(super) fn keep(&mut self, text: &str) {
        if self.kept.wholes.is_empty() {
            self.warn("of paged files only --keep at the start keeps a part; they are not in memory as a whole");
            return;
        }
        match PointFilter::of_words(text) {
            Ok(filter) => {
                self.kept.wanted = Some(filter.to_string());
                self.asks.push(FileAsk::Keep);
            }
            Err(error) => self.warn(&format!("{text}: {error}")),
        }
    }

    /// Shows all again, or the part that was shown before.
    pub(super) fn switch_kept(&mut self) {
        if self.kept.text.is_empty() && self.kept.last.is_empty() {
            self.inform("nothing is left out; the panel has a field for what is kept");
            return;
        }
        let other = match self.kept.text.is_empty() {
            true => self.kept.last.clone(),
            false => String::new(),
        };
        self.keep(&other);
    }

    /// Starts to make what was asked for.
    pub(in crate::viewer) fn start_keeping(&mut self, loader: &mut ModelLoader) {
        let Some(wanted) = &self.kept.wanted else {
            return;
        };
        let Ok(filter) = PointFilter::of_words(wanted) else {
            return;
        };
        self.tell_device(loader);
        let wholes = self.kept.wholes.clone();
        if let Err(error) = loader.start_keeping(&self.path, wholes, filter) {
            self.kept.wanted = None;
            self.warn(&format!("cannot start to keep a part: {error}"));
        }
    }

    /// Takes note that a part is shown, or that it could not be made.
    pub(super) fn part_came(&mut self, is_shown: bool) {
        let Some(wanted) = self.kept.wanted.take().filter(|_| is_shown) else {
            return;
        };
        let before = std::mem::replace(&mut self.kept.text, wanted);
        if !before.is_empty() {
            self.kept.last = before;
        }
    }

    /// Takes models that were opened; of files that were opened again the same is kept.
    pub(super) fn take_wholes(&mut self, wholes: Vec<WholeModel>, is_same: bool) {
        let text = std::mem::take(&mut self.kept.text);
        let clouds = wholes.iter().filter(|own| own.model.kind().is_points());
        let columns = clouds.filter_map(|own| own.attributes.find("class"));
        let classes: BTreeSet<u8> = columns.flat_map(classes_of).collect();
        self.kept = KeptParts {
            classes: classes.into_iter().take(MOST_CLASSES).collect(),
            wholes,
            ..KeptParts::default()
        };
        if is_same && !text.is_empty() && !self.kept.wholes.is_empty() {
            self.keep(&text);
        }
    }

    /// Gives the panel its part; none where nothing can be left out.
    pub(super) fn keep_state(&self) -> Option<KeepState> {
        let kept = &self.kept;
        let text = kept.wanted.as_ref().unwrap_or(&kept.text);
        let filter = PointFilter::of_words(text).unwrap_or_default();
        let classes = kept.classes.iter();
        (!kept.wholes.is_empty() && !self.is_preview).then(|| KeepState {
            text: text.clone(),
            classes: classes
                .map(|&class| (class, has_class(&filter, class)))
                .collect(),
        })
    }
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
