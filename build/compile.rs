//! Compiles a shader: pastes its includes in, and says where in which file an error is.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use glslang::{
    Compiler, CompilerOptions, ShaderInput, ShaderSource, ShaderStage, SourceLanguage,
    SpirvVersion, Target, VulkanVersion,
};

/// The macro that tells the variants of a shader apart: it is compiled without it and with it, and becomes a
/// `ShaderVariants`, of which each pass takes the one whose outputs are its targets.
const VARIANT: &str = "NORMALS";

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
pub(crate) fn compile(root: &Path, path: &Path, name: &str) -> Result<Vec<Vec<u32>>, String> {
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
