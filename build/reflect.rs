//! Reads back what a compiled shader declares: blocks with their offsets, and specialization constants.

use rspirv::dr::{Module, Operand};
use rspirv::spirv::{Decoration, Op};

pub(crate) fn parse(words: &[u32], name: &str) -> Module {
    let mut loader = rspirv::dr::Loader::new();
    rspirv::binary::parse_words(words, &mut loader).unwrap_or_else(|e| {
        panic!("shaders/{name}: the compiler wrote SPIR-V that cannot be read back: {e:?}")
    });
    loader.module()
}

/// Fields of a block: name and byte offset, and the size of the whole rounded up to its last field's end.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Block {
    pub(crate) fields: Vec<(String, u32)>,
    pub(crate) size: u32,
}

pub(crate) fn name_of(module: &Module, id: u32) -> String {
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

pub(crate) fn decoration(module: &Module, id: u32, wanted: Decoration) -> Option<u32> {
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

pub(crate) fn definition(module: &Module, id: u32) -> Option<&rspirv::dr::Instruction> {
    module
        .types_global_values
        .iter()
        .find(|i| i.result_id == Some(id))
}

/// A specialization constant.
pub(crate) struct Specialized {
    pub(crate) id: u32,
    pub(crate) name: String,
    /// The Rust type of its name.
    pub(crate) kind: &'static str,
}

/// Those that a module declares, ascending by number.
pub(crate) fn specialized(module: &Module) -> Vec<Specialized> {
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
pub(crate) fn blocks(module: &Module) -> Vec<(String, Block)> {
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
