//! Writes the Rust text about the shaders.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use rspirv::dr::{Module, Operand};
use rspirv::spirv::{Decoration, ExecutionMode, Op, StorageClass};

use crate::reflect::{Block, blocks, decoration, definition, name_of, specialized};

/// A `CompiledShader`, or `ShaderVariants` where there are two.
pub(crate) fn write_shader(out: &mut String, relative: &str, modules: &[(&[u32], Module)]) {
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
        [plain, ..] => ("CompiledShader", literal(&name, plain)),
        [] => panic!("shaders/{relative} has no module"),
    };
    let _ = writeln!(
        out,
        "/// `shaders/{relative}`.\npub const {constant}: {kind} = {value};\n"
    );
}

/// The Rust text of a `CompiledShader`: what its module declares, and its words.
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
        "CompiledShader {{\n    name: {name:?},\n    stage: ShaderStage::{stage},\n    push_constant_bytes: {push},\n    \
         local_size: {local:?},\n    bindings: &[{}],\n    inputs: &[{}],\n    outputs: {outputs},\n    \
         constants: &[{}],\n    \
         words: &[{}],\n}}",
        bindings.join(", "),
        inputs.join(", "),
        constants.join(", "),
        words.join(",")
    )
}

pub(crate) fn write_layouts(out: &mut String, layouts: &BTreeMap<String, (Block, String)>) {
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
pub(crate) fn write_specialization(out: &mut String, constants: &BTreeMap<String, (&str, String)>) {
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
pub(crate) fn write_constants(out: &mut String, path: &Path) {
    let text = std::fs::read_to_string(path).unwrap_or_default();
    out.push_str(
        "/// Constants of both sides, from `shaders/common/constants.glsl`.\n\
         #[allow(clippy::approx_constant, reason = \"shaders have no names for them\")]\n\
         pub mod constants {\n",
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
