//! Where a model comes from: a file, standard input, a tree file or a generator.

use super::progress::Bar;
use super::{Failure, usage};
use clap::Args;
use std::path::{Path, PathBuf};
use std::time::Instant;
use surfel::generate::{Shape, Spec};
use surfel::input;
use surfel::mesh::Mesh;
use surfel::progress::Progress;
use surfel::scenes::Entry;
use surfel::tree::{self, BuildOptions, Model};

/// The model of a command.
#[derive(Debug, Clone, Args)]
pub(crate) struct Source {
    /// Model file, - for standard input, generate:SHAPE[:TRIANGLES], or scene:NAME
    #[arg(value_name = "MODEL")]
    pub(crate) model: PathBuf,
    /// Merge vertices that are equal in position, normal and color
    #[arg(long)]
    pub(crate) weld: bool,
}

/// A model with what it took to have it.
#[derive(Debug)]
pub(crate) struct Ready {
    pub(crate) model: Model,
    /// Name for people.
    pub(crate) name: String,
    /// Format of the file, or `generated`.
    pub(crate) format: String,
    pub(crate) file_bytes: u64,
    pub(crate) load_ms: f64,
    pub(crate) build_ms: f64,
}

/// `generate:SHAPE[:TRIANGLES]`, if that is what it is.
pub(crate) fn generated(text: &Path) -> Option<Result<Spec, Failure>> {
    let rest = text.to_str()?.strip_prefix("generate:")?;
    let (shape, triangles) = match rest.split_once(':') {
        Some((shape, triangles)) => (shape, Some(triangles)),
        None => (rest, None),
    };
    Some(spec(shape, triangles))
}

/// `scene:NAME`, if that is what it is.
pub(crate) fn scene(text: &Path) -> Option<Result<&'static Entry, Failure>> {
    Some(named_scene(text.to_str()?.strip_prefix("scene:")?))
}

/// The built-in scene of that name.
pub(crate) fn named_scene(name: &str) -> Result<&'static Entry, Failure> {
    surfel::scenes::find(name).ok_or_else(|| {
        usage(format!(
            "there is no scene {name:?}; surfel scenes lists them"
        ))
    })
}

fn spec(shape: &str, triangles: Option<&str>) -> Result<Spec, Failure> {
    let shape: Shape = shape.parse()?;
    let triangles = match triangles {
        Some(text) => text
            .replace('_', "")
            .parse::<u64>()
            .map_err(|_| usage(format!("generate: {text:?} is no number of triangles")))?,
        None => 1_000_000,
    };
    Ok(Spec::with_triangles(shape, triangles)?)
}

/// Whether a file is a tree file, by its first bytes and, when it has none, by its ending.
fn is_tree_file(path: &Path) -> bool {
    // What is read from a pipe is gone for the reader of models.
    if path.metadata().is_ok_and(|found| !found.is_file()) {
        return false;
    }
    let mut start = [0; 16];
    let read =
        std::fs::File::open(path).and_then(|mut file| std::io::Read::read(&mut file, &mut start));
    match read {
        Ok(length) if length > 0 => tree::file::is_tree_file(&start[..length]),
        // Let the reader of trees say what is wrong with a file of that name.
        _ => path
            .extension()
            .is_some_and(|e| e.eq_ignore_ascii_case(tree::file::EXTENSION)),
    }
}

impl Source {
    /// Loads the model and builds its tree, with a progress bar from about a second on.
    pub(crate) fn ready(&self, quiet: bool) -> Result<Ready, Failure> {
        self.ready_with(&Bar::new(quiet), &mut |_| ())
    }

    /// Loads the model and builds its tree; `early` sees the mesh in between.
    pub(crate) fn ready_with(
        &self,
        bar: &dyn Progress,
        early: &mut dyn FnMut(&Mesh),
    ) -> Result<Ready, Failure> {
        let start = Instant::now();
        let name = self.model.display().to_string();
        if let Some(spec) = generated(&self.model) {
            let spec = spec?;
            bar.stage("generate", 0);
            let mesh = surfel::generate::mesh(&spec);
            early(&mesh);
            return self.build(mesh, name, "generated".into(), 0, start, bar);
        }
        if let Some(entry) = scene(&self.model) {
            let mesh = entry?.make().mesh;
            return self.build(mesh, name, "generated".into(), 0, start, bar);
        }
        if self.model != Path::new("-") && is_tree_file(&self.model) {
            bar.stage("read tree", 0);
            let model = tree::file::read(&self.model)?;
            let file_bytes = std::fs::metadata(&self.model).map(|m| m.len()).unwrap_or(0);
            return Ok(Ready {
                model,
                name,
                format: "surfel tree".into(),
                file_bytes,
                load_ms: start.elapsed().as_secs_f64() * 1e3,
                build_ms: 0.0,
            });
        }
        let options = input::Options {
            weld: self.weld,
            ..input::Options::default()
        };
        let loaded = input::load(&self.model, &options, bar)?;
        for warning in &loaded.warnings {
            super::say(&format!("surfel: {name}: warning: {warning}"));
        }
        let format = loaded.format.name().to_owned();
        early(&loaded.mesh);
        self.build(loaded.mesh, name, format, loaded.file_bytes, start, bar)
    }

    fn build(
        &self,
        mesh: Mesh,
        name: String,
        format: String,
        file_bytes: u64,
        start: Instant,
        bar: &dyn Progress,
    ) -> Result<Ready, Failure> {
        let load_ms = start.elapsed().as_secs_f64() * 1e3;
        let start = Instant::now();
        let model = tree::build(mesh, &BuildOptions::default(), bar)?;
        Ok(Ready {
            model,
            name,
            format,
            file_bytes,
            load_ms,
            build_ms: start.elapsed().as_secs_f64() * 1e3,
        })
    }
}
