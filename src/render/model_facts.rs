//! Facts of a model that frames ask for again and again, found once.

use crate::cut::ZeroAreaSet;
use crate::tree::Model;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering};

/// Number of models whose facts were asked for in this process.
static MODELS: AtomicU64 = AtomicU64::new(0);

/// Facts of one model; they belong to no other.
#[derive(Debug)]
pub struct ModelFacts {
    id: u64,
    has_colors: bool,
    undrawn: OnceLock<ZeroAreaSet>,
}

/// A model to be drawn, with the facts that were found of it.
#[derive(Debug, Clone, Copy)]
pub struct FactedModel<'a> {
    /// The model.
    pub model: &'a Model,
    /// Facts of this model.
    pub facts: &'a ModelFacts,
}

impl ModelFacts {
    /// Looks at the vertices of a model.
    pub fn of(model: &Model) -> Self {
        Self {
            id: MODELS.fetch_add(1, Ordering::Relaxed),
            has_colors: model.vertices.iter().any(|v| v.color != [255; 4]),
            undrawn: OnceLock::new(),
        }
    }

    /// Number that no other model of this process has or had.
    pub(crate) fn id(&self) -> u64 {
        self.id
    }

    /// Whether some vertex has a color other than white, or no normal.
    pub(crate) fn has_colors(&self) -> bool {
        self.has_colors
    }

    /// Nodes and leaves without area; found at the first call.
    pub(crate) fn undrawn(&self, model: &Model) -> &ZeroAreaSet {
        self.undrawn.get_or_init(|| ZeroAreaSet::new(model))
    }
}
