//! The cut of the next frame from the cut of the last one.
//!
//! Source: Benda, *Point Based Rendering*, section 3.3.2: go down from nodes that have become too large, climb
//! from nodes that have become small or invisible. Deviations: the cut is a list in tree order, not flags in
//! the nodes, so nothing stale is left behind and a frame does not walk the tree from the root; and a node
//! counts as open only if all of its ancestors are, each looked at once in a frame and then remembered.
//!
//! That last rule makes the result the from-root cut by construction, whatever the camera does: it needs no
//! monotone size, no nested spheres and no exact arithmetic, and the strip rule may be what it likes. (Trusting
//! the parent alone would save a quarter of the remembered tests and be wrong where rounding breaks a tie.)

use super::class::Class;
use super::tester::Tester;
use super::walk::{Item, Run, Walk};
use super::{Cut, Settings, StripRun, leaf_range};
use crate::math::camera::View;
use crate::tree::Model;

/// What one update did.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Update {
    /// Nodes and leaves where the traversal stops, drawn or not; the size of the cut.
    pub stops: u64,
    /// Of those, the ones that were not in the previous cut.
    pub changed: u64,
    /// Nodes and leaves that were looked at again or for the first time ([`super::Stats::visited`]).
    pub tests: u64,
}

/// Follows a moving camera.
///
/// Memory: 12 bytes a run of stopping siblings, and 4 bytes a node of the tree.
#[derive(Debug, Default)]
pub struct Coherent {
    /// Where the last traversal stopped, in tree order; together the runs cover every leaf once.
    runs: Vec<Run>,
    /// The runs that are being made.
    next: Vec<Run>,
    /// Frame (24 bits) and class (8 bits) of each node that was looked at.
    marks: Vec<u32>,
    frame: u32,
    leaf_count: usize,
    stack: Vec<Item>,
    path: Vec<u32>,
    nodes: Vec<u32>,
    strips: Vec<StripRun>,
    update: Update,
}

/// Number of frames that a mark can tell apart.
const FRAMES: u32 = 1 << 24;

impl Coherent {
    /// Forgets the last frame; the next update starts from the root.
    ///
    /// Needed when the model changes to another one with the same numbers of nodes and leaves but other
    /// children; different numbers are noticed.
    pub fn reset(&mut self) {
        self.runs.clear();
    }

    /// What the last update did.
    pub fn last_update(&self) -> Update {
        self.update
    }

    /// Replaces `cut` by what `view` needs of `model`, and remembers it for the next call.
    ///
    /// The lists equal those of [`super::select`] for the same arguments, whatever the calls before were;
    /// only the statistics differ. Cost: proportional to the nodes visited.
    pub fn update(&mut self, model: &Model, view: &View, settings: &Settings, cut: &mut Cut) {
        cut.clear();
        let tree = &model.tree;
        if self.marks.len() != tree.nodes.len() || self.leaf_count != tree.leaves.len() {
            self.marks.clear();
            self.marks.resize(tree.nodes.len(), 0);
            self.leaf_count = tree.leaves.len();
            self.frame = 0;
            self.runs.clear();
        }
        self.frame += 1;
        if self.frame == FRAMES {
            self.marks.fill(0);
            self.frame = 1;
        }
        self.next.clear();
        let tester = Tester::new(model, view, settings);
        let mut changed = 0;
        let runs = std::mem::take(&mut self.runs);
        let mut frame = Frame {
            number: self.frame,
            marks: &mut self.marks,
            path: &mut self.path,
            walk: Walk {
                model,
                tester: &tester,
                cut,
                stack: &mut self.stack,
                runs: &mut self.next,
            },
        };
        if runs.is_empty() {
            frame.walk.root();
            changed = count(frame.walk.runs);
        } else {
            let mut done_leaves = 0;
            for &run in &runs {
                if done_leaves > 0 {
                    if frame.first_leaf(run) < done_leaves {
                        continue;
                    }
                    done_leaves = 0;
                }
                changed += frame.run(run, &mut done_leaves);
            }
        }
        self.runs = std::mem::replace(&mut self.next, runs);
        let starts = &tree.level_starts;
        by_level(&mut cut.nodes, &mut self.nodes, starts, |&id| id);
        by_level(&mut cut.strips, &mut self.strips, starts, |strip| {
            strip.node
        });
        self.update = Update {
            stops: count(&self.runs),
            changed,
            tests: cut.stats.visited,
        };
    }
}

/// From tree order to ascending order: within a level they are the same.
fn by_level<T: Copy>(list: &mut Vec<T>, spare: &mut Vec<T>, starts: &[u32], id: fn(&T) -> u32) {
    spare.clear();
    for level in starts.windows(2) {
        if spare.len() == list.len() {
            break;
        }
        let level = level[0]..level[1];
        spare.extend(list.iter().filter(|item| level.contains(&id(item))));
    }
    std::mem::swap(list, spare);
}

fn count(runs: &[Run]) -> u64 {
    runs.iter().map(|run| u64::from(run.count)).sum()
}

/// One update.
struct Frame<'a> {
    number: u32,
    marks: &'a mut Vec<u32>,
    path: &'a mut Vec<u32>,
    walk: Walk<'a>,
}

impl Frame<'_> {
    /// The first leaf of a run.
    fn first_leaf(&self, run: Run) -> u32 {
        let tree = &self.walk.model.tree;
        let is_leaf = match tree.nodes.get(run.parent as usize) {
            Some(parent) => parent.has_leaves(),
            None => tree.nodes.is_empty(),
        };
        if is_leaf {
            run.first
        } else {
            tree.first_leaf
                .get(run.first as usize)
                .copied()
                .unwrap_or(0)
        }
    }

    /// Brings one run up to date; returns how many stops are new. `done_leaves` becomes the end of a node
    /// above that now stops, so that the caller skips the other runs below it.
    fn run(&mut self, run: Run, done_leaves: &mut u32) -> u64 {
        if run.parent == Run::ROOT {
            let before = count(self.walk.runs);
            self.walk.root();
            let is_same = self.walk.runs.first() == Some(&run);
            return if is_same {
                0
            } else {
                count(self.walk.runs) - before
            };
        }
        let inherited = match self.state(run.parent) {
            Ok(class) => class.inherited(),
            Err((top, class)) => {
                let parent = if top == 0 {
                    Run::ROOT
                } else {
                    self.parent(top)
                };
                self.walk.stop(parent, top, class);
                *done_leaves = leaf_range(&self.walk.model.tree, top).end;
                return 1;
            }
        };
        let Some(&parent) = self.walk.model.tree.nodes.get(run.parent as usize) else {
            return 0;
        };
        if parent.has_leaves() {
            self.walk
                .leaves(run.parent, run.first, run.count, inherited);
            return 0;
        }
        self.classify(run.parent, inherited);
        let mut changed = 0;
        for id in run.first..run.first.saturating_add(run.count) {
            match self.mark(id) {
                Some(class) if class.is_open() => {
                    let before = self.walk.runs.len();
                    self.walk.descend(id, class.inherited());
                    changed += count(self.walk.runs.get(before..).unwrap_or_default());
                }
                Some(class) => self.walk.stop(run.parent, id, class),
                None => {}
            }
        }
        changed
    }

    fn parent(&self, id: u32) -> u32 {
        self.walk
            .model
            .tree
            .parents
            .get(id as usize)
            .copied()
            .unwrap_or(0)
    }

    /// The class of a node if it was looked at in this frame.
    #[inline]
    fn mark(&self, id: u32) -> Option<Class> {
        let mark = *self.marks.get(id as usize)?;
        (mark >> 8 == self.number).then_some(Class::from_bits(mark as u8))
    }

    #[inline]
    fn set_mark(&mut self, id: u32, class: Class) {
        if let Some(mark) = self.marks.get_mut(id as usize) {
            *mark = self.number << 8 | u32::from(class.to_bits());
        }
    }

    /// Looks at the node children of the open node `id`, unless it was done in this frame.
    fn classify(&mut self, id: u32, inherited: u8) {
        let Some(&node) = self.walk.model.tree.nodes.get(id as usize) else {
            return;
        };
        if node.has_leaves() || self.mark(node.first_child).is_some() {
            return;
        }
        let count = u32::from(node.child_count);
        let stats = &mut self.walk.cut.stats;
        let classes =
            self.walk
                .tester
                .nodes(self.walk.model, node.first_child, count, inherited, stats);
        for (id, class) in (node.first_child..node.first_child.saturating_add(count)).zip(classes) {
            self.set_mark(id, class);
        }
    }

    /// The class of node `id` if it and everything above it is open; else the topmost node that is not, on
    /// the way from the root to `id`, with its class.
    #[inline]
    fn state(&mut self, id: u32) -> Result<Class, (u32, Class)> {
        match self.mark(id) {
            // A mark is only ever set below open nodes, so an open one is open all the way.
            Some(class) if class.is_open() => Ok(class),
            Some(class) => Err((id, class)),
            None => self.state_from_above(id),
        }
    }

    #[inline(never)]
    fn state_from_above(&mut self, id: u32) -> Result<Class, (u32, Class)> {
        self.path.clear();
        let mut at = id;
        while self.mark(at).is_none() {
            self.path.push(at);
            if at == 0 {
                break;
            }
            at = self.parent(at);
        }
        let mut above = self.mark(at);
        while let Some(id) = self.path.pop() {
            if let Some(class) = above
                && !class.is_open()
            {
                return Err((self.parent(id), class));
            }
            match above {
                None => {
                    let start = self.walk.tester.start();
                    let stats = &mut self.walk.cut.stats;
                    let [class, ..] = self.walk.tester.nodes(self.walk.model, 0, 1, start, stats);
                    self.set_mark(0, class);
                }
                Some(class) => self.classify(self.parent(id), class.inherited()),
            }
            above = self.mark(id);
        }
        match above {
            Some(class) if class.is_open() => Ok(class),
            Some(class) => Err((id, class)),
            // Only where the tree's links are wrong.
            None => Err((id, Class::DROP)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::camera::Camera;
    use crate::tree::{Cone, Leaf, Node, Strip, Tree};
    use glam::{DVec3, Vec3};

    /// Four points in a row, in two nodes below the root.
    fn row() -> Model {
        let node = |x: f32, radius: f32, first_child, flags| Node {
            center: Vec3::X * x,
            radius,
            first_child,
            cone: Cone::ALL,
            strip: Strip::SPHERE,
            child_count: 2,
            flags,
        };
        Model {
            tree: Tree {
                nodes: [
                    node(0.0, 2.0, 1, 0),
                    node(-1.0, 0.6, 0, Node::LEAF_CHILDREN),
                    node(1.0, 0.6, 2, Node::LEAF_CHILDREN),
                ][..]
                    .into(),
                parents: vec![0; 3],
                first_leaf: vec![0, 0, 2],
                level_starts: vec![0, 1, 3],
                leaves: [-1.5, -0.5, 0.5, 1.5]
                    .map(|x| Leaf {
                        center: Vec3::X * x,
                        radius: 0.1,
                    })
                    .into_iter()
                    .collect(),
                ..Tree::default()
            },
            ..Model::default()
        }
    }

    /// A mark of 2^24 frames ago must not pass for one of this frame.
    #[test]
    fn the_frame_number_wraps_without_a_trace() {
        let model = row();
        let camera = Camera::look_at(
            (400, 300),
            DVec3::new(0.2, 0.5, 4.0),
            DVec3::ZERO,
            DVec3::Y,
            0.8,
            (0.1, 20.0),
        );
        let view = camera.view(DVec3::ZERO).expect("a usable camera");
        let mut coherent = Coherent::default();
        let mut cut = Cut::default();
        // The frame number after each update, and how many nodes and leaves are drawn. Frame FRAMES - 2 marks
        // both lower nodes as open; then nothing looks at them until the same number comes again, when both
        // are to stop.
        for (number, threshold_px, nodes, leaves) in [
            (1, 0.0, 0, 4),
            (FRAMES - 2, 0.0, 0, 4),
            (FRAMES - 1, 1e4, 1, 0),
            (1, 0.0, 0, 4),
            (FRAMES - 2, 200.0, 2, 0),
        ] {
            if number == FRAMES - 2 {
                coherent.frame = number - 1;
            }
            let settings = Settings {
                threshold_px,
                ..Settings::default()
            };
            coherent.update(&model, &view, &settings, &mut cut);
            assert_eq!(coherent.frame, number);
            assert_eq!(
                (cut.nodes.len(), cut.leaves.len()),
                (nodes, leaves),
                "frame {number}"
            );
        }
    }
}
