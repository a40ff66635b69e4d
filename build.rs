//! Compiles every shader below `shaders/` and writes what Rust needs to know about them.
//!
//! * `shaders/<folder>/<pass>.{vert,frag,comp}` becomes SPIR-V 1.6 for Vulkan 1.3; `shaders/common` holds
//!   what is only included. `#include "path"` is relative to `shaders/` and takes effect once per shader.
//! * A shader that asks `#ifdef NORMALS` has two variants, see [`VARIANT`]: a fragment shader may have no output
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

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use glslang::{
    Compiler, CompilerOptions, ShaderInput, ShaderSource, ShaderStage, SourceLanguage,
    SpirvVersion, Target, VulkanVersion,
};
use rspirv::dr::{Module, Operand};
use rspirv::spirv::{Decoration, ExecutionMode, Op, StorageClass};

/// The macro that tells the variants of a shader apart: it is compiled without it and with it, and becomes a
/// `ShaderVariants`, of which each pass takes the one whose outputs are its targets.
const VARIANT: &str = "NORMALS";

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
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

/// Source text with includes pasted in; `origin[i]` is the file and line of line `i`.
struct Expanded {
    text: String,
    origin: Vec<(String, usize)>,
}

fn expand(
    root: &Path,
    path: &Path,
    name: &str,
    seen: &mut BTreeSet<PathBuf>,
    out: &mut Expanded,
) -> Result<(), String> {
    let text = std::fs::read_to_string(path)
        .map_err(|e| format!("shaders/{name}:1: error: cannot read: {e}"))?;
    for (index, line) in text.lines().enumerate() {
        let Some(rest) = line.trim_start().strip_prefix("#include") else {
            out.text.push_str(line);
            out.text.push('\n');
            out.origin.push((name.to_owned(), index + 1));
            continue;
        };
        let target = rest.trim().trim_matches('"');
        let file = root.join(target);
        if !file.is_file() {
            return Err(format!(
                "shaders/{name}:{}: error: no file shaders/{target} to include",
                index + 1
            ));
        }
        if seen.insert(file.clone()) {
            expand(root, &file, target, seen, out)?;
        }
    }
    Ok(())
}

/// SPIR-V of the shader, and where it has variants of that with [`VARIANT`] after it.
fn compile(root: &Path, path: &Path, name: &str) -> Result<Vec<Vec<u32>>, String> {
    let mut expanded = Expanded {
        text: String::new(),
        origin: Vec::new(),
    };
    expand(root, path, name, &mut BTreeSet::new(), &mut expanded)?;
    let stage = match path.extension().and_then(|e| e.to_str()) {
        Some("vert") => ShaderStage::Vertex,
        Some("frag") => ShaderStage::Fragment,
        Some("comp") => ShaderStage::Compute,
        other => {
            return Err(format!(
                "shaders/{name}:1: error: no shader stage for ending {other:?}"
            ));
        }
    };
    let compiler = Compiler::acquire().expect("glslang starts");
    let options = CompilerOptions {
        source_language: SourceLanguage::GLSL,
        target: Target::Vulkan {
            version: VulkanVersion::Vulkan1_3,
            spirv_version: SpirvVersion::SPIRV1_6,
        },
        ..CompilerOptions::default()
    };
    let source = ShaderSource::from(expanded.text.as_str());
    let asks = format!("#ifdef {VARIANT}");
    let has_variants = expanded.text.lines().any(|line| line.trim() == asks);
    let compiled = |defines: &[(&str, Option<&str>)]| {
        let input = ShaderInput::new(&source, stage, &options, Some(defines), None)
            .map_err(|e| format!("shaders/{name}:1: error: {e}"))?;
        compiler
            .create_shader(input)
            .and_then(|shader| shader.compile())
            .map_err(|e| place(&e.to_string(), name, &expanded))
    };
    let mut variants = vec![compiled(&[])?];
    if has_variants {
        variants.push(compiled(&[(VARIANT, None)])?);
    }
    Ok(variants)
}

/// Turns `ERROR: 0:LINE: text` of the compiler into `shaders/file:line: error: text`.
fn place(log: &str, name: &str, expanded: &Expanded) -> String {
    let mut out = Vec::new();
    for line in log.lines() {
        let Some(at) = line.find("ERROR: 0:") else {
            continue;
        };
        let rest = &line[at + "ERROR: 0:".len()..];
        let Some((number, text)) = rest.split_once(':') else {
            continue;
        };
        let line = number.trim().parse::<usize>().unwrap_or(0);
        let (file, line) = expanded
            .origin
            .get(line.wrapping_sub(1))
            .cloned()
            .unwrap_or((name.to_owned(), line));
        out.push(format!("shaders/{file}:{line}: error:{text}"));
    }
    if out.is_empty() {
        out.push(format!("shaders/{name}:1: error: {log}"));
    }
    out.join("\n")
}

fn parse(words: &[u32], name: &str) -> Module {
    let mut loader = rspirv::dr::Loader::new();
    rspirv::binary::parse_words(words, &mut loader).unwrap_or_else(|e| {
        panic!("shaders/{name}: the compiler wrote SPIR-V that cannot be read back: {e:?}")
    });
    loader.module()
}

/// Fields of a block: name and byte offset, and the size of the whole rounded up to its last field's end.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Block {
    fields: Vec<(String, u32)>,
    size: u32,
}

fn name_of(module: &Module, id: u32) -> String {
    module
        .debug_names
        .iter()
        .find_map(|i| match (i.class.opcode, i.operands.as_slice()) {
            (Op::Name, [Operand::IdRef(target), Operand::LiteralString(text)]) if *target == id => {
                Some(text.clone())
            }
            _ => None,
        })
        .unwrap_or_default()
}

fn decoration(module: &Module, id: u32, wanted: Decoration) -> Option<u32> {
    module
        .annotations
        .iter()
        .find_map(|i| match (i.class.opcode, i.operands.as_slice()) {
            (Op::Decorate, [Operand::IdRef(target), Operand::Decoration(d), rest @ ..])
                if *target == id && *d == wanted =>
            {
                match rest.first() {
                    Some(Operand::LiteralBit32(value)) => Some(*value),
                    _ => Some(0),
                }
            }
            _ => None,
        })
}

fn definition(module: &Module, id: u32) -> Option<&rspirv::dr::Instruction> {
    module
        .types_global_values
        .iter()
        .find(|i| i.result_id == Some(id))
}

/// A specialization constant.
struct Specialized {
    id: u32,
    name: String,
    /// The Rust type of its name.
    kind: &'static str,
}

/// Those that a module declares, ascending by number.
fn specialized(module: &Module) -> Vec<Specialized> {
    let mut found: Vec<_> = module
        .types_global_values
        .iter()
        .filter_map(|i| {
            let kind = match i.class.opcode {
                Op::SpecConstantTrue | Op::SpecConstantFalse => "BoolConstant",
                Op::SpecConstant => "UintConstant",
                _ => return None,
            };
            let target = i.result_id?;
            Some(Specialized {
                id: decoration(module, target, Decoration::SpecId)?,
                name: name_of(module, target),
                kind,
            })
        })
        .collect();
    found.sort_by_key(|constant| constant.id);
    found
}

/// Every structure with explicit offsets, by name.
fn blocks(module: &Module) -> Vec<(String, Block)> {
    let mut out = Vec::new();
    for instruction in &module.types_global_values {
        let (Op::TypeStruct, Some(id)) = (instruction.class.opcode, instruction.result_id) else {
            continue;
        };
        let mut fields = Vec::new();
        for (index, operand) in instruction.operands.iter().enumerate() {
            let offset = module.annotations.iter().find_map(|i| {
                match (i.class.opcode, i.operands.as_slice()) {
                    (
                        Op::MemberDecorate,
                        [
                            Operand::IdRef(t),
                            Operand::LiteralBit32(m),
                            Operand::Decoration(Decoration::Offset),
                            Operand::LiteralBit32(o),
                        ],
                    ) if *t == id && *m as usize == index => Some(*o),
                    _ => None,
                }
            });
            let field = module.debug_names.iter().find_map(|i| {
                match (i.class.opcode, i.operands.as_slice()) {
                    (
                        Op::MemberName,
                        [
                            Operand::IdRef(t),
                            Operand::LiteralBit32(m),
                            Operand::LiteralString(text),
                        ],
                    ) if *t == id && *m as usize == index => Some(text.clone()),
                    _ => None,
                }
            });
            if let (Some(offset), Some(field), Operand::IdRef(kind)) = (offset, field, operand) {
                fields.push((field, offset, size_of(module, *kind)));
            }
        }
        let Some((_, offset, size)) = fields.last().cloned() else {
            continue;
        };
        let name = name_of(module, id);
        if name.is_empty() || name.starts_with("gl_") {
            continue;
        }
        let block = Block {
            fields: fields.into_iter().map(|(n, o, _)| (n, o)).collect(),
            size: offset + size,
        };
        out.push((name, block));
    }
    out
}

/// Size in bytes of a type inside a block; 0 for a run-time array.
fn size_of(module: &Module, id: u32) -> u32 {
    let Some(i) = definition(module, id) else {
        return 0;
    };
    let literal = |n: usize| match i.operands.get(n) {
        Some(Operand::LiteralBit32(value)) => *value,
        _ => 0,
    };
    let inner = || match i.operands.first() {
        Some(Operand::IdRef(id)) => *id,
        _ => 0,
    };
    match i.class.opcode {
        Op::TypeInt | Op::TypeFloat => literal(0) / 8,
        Op::TypeVector => literal(1) * size_of(module, inner()),
        // Column-major matrices of four-component columns are the only ones used in blocks.
        Op::TypeMatrix => literal(1) * size_of(module, inner()),
        // Only arrays of four-component vectors, which lie close.
        Op::TypeArray => {
            let length = match i.operands.get(1) {
                Some(Operand::IdRef(id)) => definition(module, *id),
                _ => None,
            };
            match length.and_then(|length| length.operands.first()) {
                Some(Operand::LiteralBit32(count)) => *count * size_of(module, inner()),
                _ => 0,
            }
        }
        _ => 0,
    }
}

/// A `Shader`, or `ShaderVariants` where there are two.
fn write_shader(out: &mut String, relative: &str, modules: &[(&[u32], Module)]) {
    let (stem, ending) = relative
        .rsplit_once('.')
        .expect("a shader file has an ending");
    let constant = format!("{}_{}", stem.replace(['/', '-', '.'], "_"), ending).to_uppercase();
    let name = format!("{}.{ending}", stem.replace('/', "."));
    let literal = |name: &str, (words, module): &(&[u32], Module)| {
        shader_literal((relative, name), ending, words, module)
    };
    let (kind, value) = match modules {
        [plain, variant] => (
            "ShaderVariants",
            format!(
                "ShaderVariants {{\nplain: &{},\nwith_normals: &{} }}",
                literal(&name, plain),
                literal(&format!("{name} with normals"), variant)
            ),
        ),
        [plain, ..] => ("Shader", literal(&name, plain)),
        [] => panic!("shaders/{relative} has no module"),
    };
    let _ = writeln!(
        out,
        "/// `shaders/{relative}`.\npub const {constant}: {kind} = {value};\n"
    );
}

/// The Rust text of a `Shader`: what its module declares, and its words.
fn shader_literal(
    (relative, name): (&str, &str),
    ending: &str,
    words: &[u32],
    module: &Module,
) -> String {
    let stage = match ending {
        "vert" => "Vertex",
        "frag" => "Fragment",
        _ => "Compute",
    };
    let mut bindings = Vec::new();
    let mut inputs = Vec::new();
    let mut outputs = 0;
    let mut push = 0;
    for i in &module.types_global_values {
        let (Op::Variable, Some(id)) = (i.class.opcode, i.result_id) else {
            continue;
        };
        let Some(Operand::StorageClass(class)) = i.operands.first() else {
            continue;
        };
        let pointee = i
            .result_type
            .and_then(|t| definition(module, t))
            .and_then(|p| match p.operands.get(1) {
                Some(Operand::IdRef(id)) => Some(*id),
                _ => None,
            })
            .unwrap_or(0);
        match class {
            StorageClass::Uniform | StorageClass::StorageBuffer | StorageClass::UniformConstant => {
                let binding = decoration(module, id, Decoration::Binding).unwrap_or(0);
                let set = decoration(module, id, Decoration::DescriptorSet).unwrap_or(0);
                assert!(
                    set == 0,
                    "shaders/{relative}: only descriptor set 0 is used"
                );
                let kind = match class {
                    StorageClass::Uniform => "UniformBuffer",
                    StorageClass::StorageBuffer => "StorageBuffer",
                    _ => match definition(module, pointee).map(|d| d.class.opcode) {
                        Some(Op::TypeSampledImage) => "SampledImage",
                        _ => "StorageImage",
                    },
                };
                bindings.push((binding, kind));
            }
            StorageClass::PushConstant => {
                push = blocks(module)
                    .iter()
                    .map(|(n, b)| {
                        if *n == name_of(module, pointee) {
                            b.size
                        } else {
                            0
                        }
                    })
                    .max()
                    .unwrap_or(0);
            }
            StorageClass::Input if ending == "vert" => {
                if let Some(location) = decoration(module, id, Decoration::Location) {
                    inputs.push((location, name_of(module, id)));
                }
            }
            StorageClass::Output if ending == "frag" => {
                if let Some(location) = decoration(module, id, Decoration::Location) {
                    outputs = outputs.max(location + 1);
                }
            }
            _ => {}
        }
    }
    bindings.sort();
    inputs.sort();
    let local = module
        .execution_modes
        .iter()
        .find_map(|i| match i.operands.as_slice() {
            [
                _,
                Operand::ExecutionMode(ExecutionMode::LocalSize),
                Operand::LiteralBit32(x),
                Operand::LiteralBit32(y),
                Operand::LiteralBit32(z),
            ] => Some([*x, *y, *z]),
            _ => None,
        })
        .unwrap_or([1, 1, 1]);
    let bindings: Vec<String> = bindings
        .iter()
        .map(|(b, k)| format!("({b}, BindingKind::{k})"))
        .collect();
    let inputs: Vec<String> = inputs
        .iter()
        .map(|(l, n)| format!("({l}, {n:?})"))
        .collect();
    let constants: Vec<String> = specialized(module)
        .iter()
        .map(|c| format!("({}, {:?})", c.id, c.name))
        .collect();
    let words: Vec<String> = words.iter().map(|w| format!("{w:#x}")).collect();
    format!(
        "Shader {{\n    name: {name:?},\n    stage: Stage::{stage},\n    push_constant_bytes: {push},\n    \
         local_size: {local:?},\n    bindings: &[{}],\n    inputs: &[{}],\n    outputs: {outputs},\n    \
         constants: &[{}],\n    \
         words: &[{}],\n}}",
        bindings.join(", "),
        inputs.join(", "),
        constants.join(", "),
        words.join(",")
    )
}

fn write_layouts(out: &mut String, layouts: &BTreeMap<String, (Block, String)>) {
    out.push_str(
        "/// Byte offsets of the fields of every block that a shader declares.\npub mod layout {\n",
    );
    for (name, (block, first)) in layouts {
        let mut module = String::new();
        for (i, c) in name.chars().enumerate() {
            if c.is_uppercase() && i > 0 {
                module.push('_');
            }
            module.push(c.to_ascii_lowercase());
        }
        let _ = writeln!(
            out,
            "    /// Block `{name}`, first seen in `shaders/{first}`.\n    pub mod {module} {{"
        );
        for (field, offset) in &block.fields {
            let _ = writeln!(
                out,
                "        /// Offset of `{field}`.\n        pub const {}: usize = {offset};",
                field.to_uppercase()
            );
        }
        let _ = writeln!(
            out,
            "        /// End of the last field.\n        pub const END: usize = {};",
            block.size
        );
        let _ = writeln!(
            out,
            "        /// Number of fields.\n        pub const FIELDS: usize = {};\n    }}",
            block.fields.len()
        );
    }
    out.push_str("}\n\n");
}

/// The names of specialization constants, each with the type of its values.
fn write_specialization(out: &mut String, constants: &BTreeMap<String, (&str, String)>) {
    out.push_str(
        "/// Specialization constants of the shaders, by name.\npub mod specialization {\n    \
         use super::{BoolConstant, UintConstant};\n",
    );
    for (name, (kind, first)) in constants {
        let _ = writeln!(
            out,
            "    /// First seen in `shaders/{first}`.\n    pub const {name}: {kind} = {kind}({name:?});"
        );
    }
    out.push_str("}\n\n");
}

/// `const uint NAME = 3u;` and `const float NAME = 0.8;` become Rust constants; a comment line before them
/// becomes their documentation.
fn write_constants(out: &mut String, path: &Path) {
    let text = std::fs::read_to_string(path).unwrap_or_default();
    out.push_str(
        "/// Constants of both sides, from `shaders/common/constants.glsl`.\npub mod constants {\n",
    );
    let mut doc = String::new();
    for (index, line) in text.lines().enumerate() {
        let line = line.trim();
        if let Some(comment) = line.strip_prefix("//") {
            doc = comment.trim().to_owned();
            continue;
        }
        let Some(rest) = line.strip_prefix("const ") else {
            continue;
        };
        let parsed = rest
            .strip_suffix(';')
            .and_then(|r| r.split_once('='))
            .and_then(|(left, value)| {
                let (kind, name) = left.trim().split_once(' ')?;
                let kind = match kind {
                    "uint" => "u32",
                    "float" => "f32",
                    _ => return None,
                };
                Some((kind, name.trim(), value.trim().trim_end_matches('u')))
            });
        match parsed {
            Some((kind, name, value)) => {
                let _ = writeln!(
                    out,
                    "    /// {doc}\n    pub const {name}: {kind} = {value};"
                );
            }
            None => {
                println!(
                    "cargo::error=shaders/common/constants.glsl:{}: error: not `const uint|float NAME = literal;`",
                    index + 1
                );
                std::process::exit(1);
            }
        }
    }
    out.push_str("}\n");
}
