//! Values of specialization constants, joined to the shaders by their names.

use crate::abi::{CompiledShader, ConstantValue, specialization};
use ash::vk;

/// The values of one shader's specialization constants.
pub(super) struct SpecializedConstants {
    values: Vec<u8>,
    entries: Vec<vk::SpecializationMapEntry>,
}

impl SpecializedConstants {
    /// Values that `shader` takes of `constants`, and the flags of the frame (0: not known).
    pub(super) fn new(shader: &CompiledShader, constants: &[ConstantValue], flags: u32) -> Self {
        let flags = specialization::KNOWN_FLAGS.is(flags);
        let all = constants.iter().chain([&flags]);
        let found = shader.constants.iter().filter_map(|(id, name)| {
            let value = all.clone().find(|constant| constant.name == *name)?.value;
            Some((*id, value))
        });
        let (mut values, mut entries) = (Vec::new(), Vec::new());
        for (id, value) in found {
            entries.push(
                vk::SpecializationMapEntry::default()
                    .constant_id(id)
                    .offset(values.len() as u32)
                    .size(size_of::<u32>()),
            );
            values.extend(value.to_ne_bytes());
        }
        Self { values, entries }
    }

    pub(super) fn info(&self) -> vk::SpecializationInfo<'_> {
        vk::SpecializationInfo::default()
            .map_entries(&self.entries)
            .data(&self.values)
    }
}

/// Holds values to the specialization constants of the shaders of a pipeline: each but the flags of the frame has one, and
/// there are no others.
///
/// # Panics
/// When that is not so.
pub(super) fn check_constants(
    pipeline: &str,
    shaders: &[&CompiledShader],
    constants: &[ConstantValue],
) {
    let declared = || shaders.iter().flat_map(|shader| shader.constants);
    for (_, name) in declared() {
        let is_given = constants.iter().any(|constant| constant.name == *name);
        assert!(
            is_given || *name == specialization::KNOWN_FLAGS.is(0).name,
            "{pipeline}: specialization constant {name} has no value"
        );
    }
    for ConstantValue { name, .. } in constants {
        assert!(
            declared().any(|(_, declared)| declared == name),
            "{pipeline}: its shaders have no specialization constant {name}"
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_specialization_constant_has_a_value_and_no_other() {
        use crate::abi::shaders::{POINTS_DRAW_VERT, SPLATS_ROUND_VERT};
        use crate::abi::specialization::{IS_GAUSS, IS_ORIENTED, IS_QUAD};
        let both = [IS_QUAD.is(true), IS_ORIENTED.is(false)];
        check_constants("whole", &[&SPLATS_ROUND_VERT], &both);
        let faulty = |shader: &CompiledShader, constants: &[ConstantValue]| {
            std::panic::catch_unwind(|| check_constants("faulty", &[shader], constants)).is_err()
        };
        assert!(faulty(&SPLATS_ROUND_VERT, &both[..1]));
        assert!(faulty(&POINTS_DRAW_VERT, &both));
        assert!(faulty(
            &SPLATS_ROUND_VERT,
            &[both[0], both[1], IS_GAUSS.is(true)]
        ));
        // Each gets its own, by name and not by place.
        let values = |shader| SpecializedConstants::new(shader, &both, 7).values;
        let bytes = |words: &[u32]| {
            words
                .iter()
                .flat_map(|w| w.to_ne_bytes())
                .collect::<Vec<_>>()
        };
        assert_eq!(values(&SPLATS_ROUND_VERT), bytes(&[0, 1, 7]));
        assert_eq!(values(&POINTS_DRAW_VERT), bytes(&[1, 7]));
    }
}
