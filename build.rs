//! Compiles every shader below `shaders/` and writes what Rust needs to know about them.
//!
//! * `shaders/<folder>/<pass>.{vert,frag,comp}` becomes SPIR-V 1.6 for Vulkan 1.3; `shaders/common` holds
//!   what is only included. `#include "path"` is relative to `shaders/` and takes effect once per shader.
//! * A shader that asks `#ifdef NORMALS` has two variants, see `compile::VARIANT`: a fragment shader may have no output
//!   that its pass has no target for, and a specialization constant takes none away.
//! * The offsets of every block that a shader declares go into `layout::<block>`, which `src/abi.rs` compares
//!   with the Rust structure at compile time. Two shaders that disagree about a block stop the build.
//! * Constants in `shaders/common/constants.glsl` become Rust constants.
//! * Specialization constants are given values by their names, which go into `specialization`; numbers matter to
//!   their shader alone. Two of a shader with one number, or two kinds under one name, stop the build.
//!
//! Programs whose figures are kept (release builds) are also told the commit that they are built from.
//!
//! An error stops the build with `file:line`.

#[path = "build/compile.rs"]
mod compile;
#[path = "build/reflect.rs"]
mod reflect;
#[path = "build/write.rs"]
mod write;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use compile::compile;
use reflect::{Block, blocks, parse, specialized};
use write::{write_constants, write_layouts, write_shader, write_specialization};

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-changed=build");
    println!("cargo::rerun-if-changed=shaders");
    let root = PathBuf::from(env("CARGO_MANIFEST_DIR")).join("shaders");
    let mut sources = Vec::new();
    collect(&root, &mut sources);
    sources.sort();

    let mut layouts: BTreeMap<String, (Block, String)> = BTreeMap::new();
    let mut out = String::from("// Written by build.rs from shaders/.\n\n");
    let mut failures = Vec::new();
    let mut specialization: BTreeMap<String, (&str, String)> = BTreeMap::new();
    for path in &sources {
        println!("cargo::rerun-if-changed={}", path.display());
        let relative = path
            .strip_prefix(&root)
            .unwrap_or(path)
            .to_string_lossy()
            .replace('\\', "/");
        if relative.starts_with("common/") {
            continue;
        }
        match compile(&root, path, &relative) {
            Ok(variants) => {
                let modules: Vec<_> = variants
                    .iter()
                    .map(|words| (words.as_slice(), parse(words, &relative)))
                    .collect();
                for (name, block) in modules.iter().flat_map(|(_, module)| blocks(module)) {
                    match layouts.get(&name) {
                        Some((known, first)) if *known != block => failures.push(format!(
                            "shaders/{relative}:1: error: block {name} differs from the one in shaders/{first}:\n  here:  {block:?}\n  there: {known:?}"
                        )),
                        Some(_) => {}
                        None => {
                            layouts.insert(name, (block, relative.clone()));
                        }
                    }
                }
                for constant in modules.iter().flat_map(|(_, module)| specialized(module)) {
                    let (kind, first) = specialization
                        .entry(constant.name.clone())
                        .or_insert((constant.kind, relative.clone()));
                    if *kind != constant.kind {
                        failures.push(format!(
                            "shaders/{relative}:1: error: constant {} is of another kind in shaders/{first}",
                            constant.name
                        ));
                    }
                }
                for (_, module) in &modules {
                    let constants = specialized(module);
                    for pair in constants.windows(2).filter(|pair| pair[0].id == pair[1].id) {
                        failures.push(format!(
                            "shaders/{relative}:1: error: constants {} and {} have the same number",
                            pair[0].name, pair[1].name
                        ));
                    }
                }
                write_shader(&mut out, &relative, &modules);
            }
            Err(text) => failures.push(text),
        }
    }
    if !failures.is_empty() {
        for line in failures.join("\n").lines() {
            println!("cargo::error={line}");
        }
        std::process::exit(1);
    }
    write_layouts(&mut out, &layouts);
    write_specialization(&mut out, &specialization);
    write_constants(&mut out, &root.join("common/constants.glsl"));
    let target = PathBuf::from(env("OUT_DIR")).join("shaders.rs");
    std::fs::write(&target, out)
        .unwrap_or_else(|e| panic!("cannot write {}: {e}", target.display()));
    println!("cargo::rustc-env=SURFEL_COMMIT={}", commit());
}

/// The commit of the sources: what `SURFEL_COMMIT` says, else what git says of this folder, else nothing.
///
/// Builds for development ask no git: a commit would build all tests anew, and their figures are not kept.
fn commit() -> String {
    println!("cargo::rerun-if-env-changed=SURFEL_COMMIT");
    if let Ok(told) = std::env::var("SURFEL_COMMIT") {
        return told.trim().to_owned();
    }
    let root = PathBuf::from(env("CARGO_MANIFEST_DIR"));
    // Sources of an archive may lie within a repository of something else.
    if env("PROFILE") == "debug" || !root.join(".git").exists() {
        return String::new();
    }
    let git = |arguments: &[&str]| {
        let output = std::process::Command::new("git")
            .arg("-C")
            .arg(&root)
            .args(arguments)
            .output()
            .ok()?;
        let text = String::from_utf8(output.stdout).ok()?;
        output.status.success().then(|| text.trim().to_owned())
    };
    // Every commit and every change of branch appends to the log.
    for watched in ["HEAD", "logs/HEAD"] {
        let path = git(&["rev-parse", "--git-path", watched]).map(|path| root.join(path));
        if let Some(path) = path.filter(|path| path.exists()) {
            println!("cargo::rerun-if-changed={}", path.display());
        }
    }
    git(&["rev-parse", "--short=12", "HEAD"]).unwrap_or_default()
}

fn env(name: &str) -> String {
    std::env::var(name).unwrap_or_else(|_| panic!("cargo did not set {name}"))
}

fn collect(folder: &Path, out: &mut Vec<PathBuf>) {
    let entries = std::fs::read_dir(folder)
        .unwrap_or_else(|e| panic!("cannot list {}: {e}", folder.display()));
    for entry in entries.flatten() {
        let path = entry.path();
        if path.is_dir() {
            collect(&path, out);
        } else if matches!(
            path.extension().and_then(|e| e.to_str()),
            Some("vert" | "frag" | "comp" | "glsl")
        ) {
            out.push(path);
        }
    }
}
